"""What a look into a map is made of: steps of a fit, when to search again, what counts as one."""

import math

import numpy as np
import pytest

from slams.localize.chart import Chart
from slams.localize.chart_kernels import TURN, fit
from slams.localize.finder import STILL, Finder
from slams.localize.localizer import Localizer
from slams.localize.places import TURNS, Places, _lattice, view_of
from slams.localize.search import TIE, Atlas, Candidate, is_same, with_odds
from slams.localize.virtual import stations
from slams.types import IDENTITY, Laser, Pose2, Scan
from tests.floors import grid_of
from tests.rooms import ROOM, box, laser, scan_at

LIDAR = laser(181)
HERE, THERE = Pose2(0.0, 0.0, 0.0), Pose2(5.0, 1.0, 0.0)


class Guide(Atlas):
    """An atlas that takes every pose for right, `drift` further on; it counts the searches."""

    def __init__(self, *poses, drift=IDENTITY):
        self.poses, self.drift, self.searches = poses, drift, 0

    def search(self, scan):
        self.searches += 1
        return with_odds([Candidate(pose, 0.9, 0.0, 1.0) for pose in self.poses])

    def look(self, scan, pose):
        return Candidate(pose @ self.drift, 0.9, 0.0, 1.0)


def stamped(t, odometry=None):
    return scan_at((0.0, 0.0, 0.0), LIDAR, t=t, odometry=odometry)


def test_one_step_of_a_fit_is_limited():
    chart, pose = Chart(grid_of(ROOM)), Pose2(1.0, 0.5, 0.0)
    ends = scan_at(pose, LIDAR).ranges[:, None] * LIDAR.directions
    for off, soft in ((Pose2(0.1, 0.08, 0.0), 0.2), (Pose2(0.0, 0.0, 0.15), 2.0)):
        start = chart._inner(pose @ off)
        moved = start.copy()
        fit(chart.cells, ends / chart.resolution, np.array([soft]), 1, moved)
        steps = np.abs(moved - start)
        assert (steps[:2] <= 1.0001 * soft).all() and steps[2] <= 1.0001 * TURN
        assert steps[2] == pytest.approx(TURN) or steps[:2].max() == pytest.approx(soft)


@pytest.mark.parametrize(
    ("odometry", "searches"),
    [
        (Pose2(0.29, 0.0, 0.0), 1),
        (Pose2(0.25, 0.25, 0.0), 2),
        (Pose2(0.0, 0.0, 0.29), 1),
        (Pose2(0.0, 0.0, -0.31), 2),
    ],
)
def test_the_map_is_searched_again_after_a_way_or_a_turn(odometry, searches):
    guide = Guide(HERE, THERE)
    finder = Finder(guide)
    for k, pose in enumerate((IDENTITY, odometry)):
        assert finder.add(stamped(0.1 * k, pose)) is None
    assert guide.searches == searches


def test_the_map_is_searched_again_after_a_time_of_standing_still():
    guide = Guide(HERE, THERE)
    finder = Finder(guide)
    for t in (0.0, 0.5 * STILL, 0.95 * STILL):
        finder.add(stamped(t))
    assert guide.searches == 1
    finder.add(stamped(1.01 * STILL))
    assert guide.searches == 2
    finder.add(stamped(1.5 * STILL))
    assert guide.searches == 2


def test_places_move_by_the_wheels_and_without_them_by_their_last_step():
    step = Pose2(0.1, 0.0, 0.05)
    for wheels, moved in ((True, step), (False, IDENTITY)):
        finder = Finder(Guide(HERE, THERE))
        for k in range(2):
            finder.add(stamped(0.1 * k, Pose2(*(k * v for v in step)) if wheels else None))
        assert [c.pose for c in finder.candidates] == [HERE @ moved, THERE @ moved]
    finder = Finder(Guide(HERE, THERE, drift=Pose2(0.1, 0.0, 0.0)))
    for k in range(3):
        finder.add(stamped(0.1 * k))
    assert finder.candidates[0].pose.x == pytest.approx(0.1 + 0.2)


def test_odds_stay_between_searches_and_count_in_the_next():
    guide = Guide(HERE, THERE)
    finder = Finder(guide)
    finder.add(stamped(0.0))
    finder.candidates = [
        c._replace(odds=odds) for c, odds in zip(finder.candidates, (0.8, 0.2), strict=True)
    ]
    finder.add(stamped(0.1))
    assert [c.odds for c in finder.candidates] == [0.8, 0.2]
    guide.poses = (HERE, THERE, Pose2(9.0, 9.0, 0.0))
    finder.add(stamped(3.0))
    assert [c.odds for c in finder.candidates] == pytest.approx(
        [0.8 / 1.01, 0.2 / 1.01, 0.01 / 1.01]
    )


def test_a_place_that_the_map_does_not_explain_is_not_found_however_alone():
    finder = Finder(Guide(HERE))
    assert finder.add(stamped(0.0)).pose == HERE
    finder.candidates = [Candidate(HERE, 0.6, 0.2, 1.0)]  # evidence 0.4
    assert finder.found is None


def test_one_place_is_within_half_a_meter_and_fifteen_degrees():
    for other, same in (
        (Pose2(0.3, 0.3, 0.2), True),
        (Pose2(0.4, 0.4, 0.0), False),
        (Pose2(0.0, 0.0, 0.3), False),
        (Pose2(0.0, 0.0, -0.3), False),
        (Pose2(0.0, 0.0, 6.2), True),
    ):
        assert is_same(HERE, other) == same


def test_a_tie_is_as_good_and_beyond_it_odds_fall():
    def odds_of(less):
        return with_odds([Candidate(HERE, 0.9, 0.0, 1.0), Candidate(THERE, 0.9 - less, 0.0, 1.0)])

    assert [c.odds for c in odds_of(0.9 * TIE)] == pytest.approx([0.5, 0.5])
    first, second = odds_of(TIE + 0.02)
    assert second.odds / first.odds == pytest.approx(math.exp(-30.0 * 0.02))


def test_where_people_pull_a_fit_away_the_rough_pose_stands(monkeypatch):
    atlas, start = Atlas(grid_of(ROOM)), Pose2(1.0, 0.5, 0.0)
    ends = scan_at(start, LIDAR).ranges[:, None] * LIDAR.directions
    for away, stands in ((Pose2(1.5, 1.0, 0.5), True), (start, False)):
        monkeypatch.setattr(atlas.chart, "fit", lambda points, pose, away=away: away)
        rough = Pose2(1.02, 0.5, 0.0)
        assert atlas._looked_at(ends, rough).pose == (rough if stands else away)


def test_the_pose_found_is_that_of_the_base():
    mount = Pose2(0.3, 0.1, 0.5)
    lidar, pose = laser(361, mount=mount), Pose2(1.0, 0.5, 0.3)
    atlas = Atlas(grid_of(ROOM))
    scan = scan_at(pose, lidar)
    for found in (atlas.search(scan)[0].pose, atlas.look(scan, pose).pose):
        assert found == pytest.approx(pose, abs=0.06)


def test_of_the_beams_in_one_direction_the_one_nearest_to_its_middle_counts():
    step = 2.0 * math.pi / TURNS
    lidar = Laser(-0.4 * step, 0.3 * step, 3, 0.1, 30.0)  # at -0.4, -0.1 and 0.2 of a direction
    view = view_of(Scan(0.0, np.array([1.0, 2.0, 3.0], np.float32), lidar))
    assert (view.directions.tolist(), view.ranges.tolist()) == ([0], [200])


def test_what_the_map_explains_is_seen_from_the_laser():
    class Still:
        """An algorithm that stays where it was put."""

        frozen = False

        def insert_at(self, scan, pose):
            pass

    lidar, pose = laser(361, mount=Pose2(0.5, 0.2, 2.0)), Pose2(1.0, 0.5, 0.3)
    localizer = Localizer(Still(), Atlas(grid_of(ROOM)), pose)
    assert localizer.update(scan_at(pose, lidar)) == pose
    assert localizer.explained > 0.95


def test_far_ranges_may_differ_by_more(monkeypatch):
    places = Places(Chart(grid_of(ROOM)))
    told = []
    monkeypatch.setattr("slams.localize.places.compare", lambda *args: told.append(args[3]))
    view = view_of(scan_at((0.0, 0.0, 0.0), LIDAR))
    places.rank(view, 1)
    expected = 100.0 * 0.8 * places.pitch + 0.03 * view.ranges  # cm
    assert np.abs(told[0] - expected).max() <= 1.0


def test_walls_farther_than_a_meter_do_not_pull():
    chart = Chart(grid_of(ROOM))
    assert chart.cells.distance.max() == pytest.approx(1.0 / chart.resolution)


def test_a_virtual_drive_stands_in_the_middle_of_cells():
    chart = Chart(grid_of(ROOM))
    cells = (stations(chart) - chart.origin) / chart.resolution
    assert len(cells) > 20 and cells % 1.0 == pytest.approx(0.5, abs=1e-6)


def test_a_virtual_drive_goes_from_place_to_place_without_leaps():
    places = stations(Chart(grid_of(np.array(box(0.0, 0.0, 8.0, 5.0)), inside=(1.0, 1.0))))
    assert np.hypot(*np.diff(places, axis=0).T).max() < 2.0


def test_the_places_of_a_lattice_are_half_a_pitch_from_the_edge_and_one_apart():
    chart = Chart(grid_of(np.array(box(0.0, 0.0, 8.0, 5.0)), inside=(1.0, 1.0)))
    cells = _lattice(chart, 0.5)
    assert cells % 10.0 == pytest.approx(5.0)
    assert len(cells) == pytest.approx(8.0 * 5.0 / 0.25, rel=0.15)
