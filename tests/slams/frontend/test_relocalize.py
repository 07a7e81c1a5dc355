"""Relocalization: a lost robot is searched in its own map, with bounded work per scan."""

import math

import numpy as np
import pytest

from slams.frontend import relocalize
from slams.frontend.relocalize import Relocalizer, coarsened
from slams.grid_bounds import Box
from slams.localize import map_index
from slams.localize.distance_map import DistanceMap
from slams.localize.global_localizer import GlobalLocalizer
from slams.localize.map_index import Candidate, MapIndex, Search, Work, end_points, merged
from slams.test_world import odd_scans
from slams.types import IDENTITY, OccupancyGrid, Pose2, Scan
from tests.floors import ALIKE, LIDAR, grid_of, noisy, searched
from tests.rooms import ROOM, box, calls, laser, scan_at
from tests.slams.test_state import copied

HERE, GUESS = Pose2(1.5, -2.0, 2.0), Pose2(-2.5, 1.0, -0.5)

# ten rooms in two rows along a corridor, each with a cupboard of its own and a door
OFFICE = np.array(
    [
        *box(0.0, 0.0, 25.0, 12.0),
        *[wall for k in range(1, 5) for wall in ((5.0 * k, 0.0, 5.0 * k, 5.0),)],
        *[(5.0 * k, 7.0, 5.0 * k, 12.0) for k in range(1, 5)],
        *[(5.0 * k + a, y, 5.0 * k + b, y) for k in range(5) for a, b, y in
          ((0.0, 2.0, 5.0), (3.0, 5.0, 5.0), (0.0, 1.0 + 0.4 * k, 7.0), (2.0 + 0.4 * k, 5.0, 7.0))],
        *[side for k in range(5) for side in box(5 * k + 0.6, 0.5, 5 * k + 1.2 + 0.3 * k, 1.1)],
        *[side for k in range(5) for side in box(5 * k + 3.2 - 0.4 * k, 10.0, 5 * k + 4.0, 10.7)],
    ]
)  # fmt: skip


class Map:
    """Draws parts of a grid and keeps what was asked for."""

    def __init__(self, grid=None):
        self.grid, self.boxes = grid_of(ROOM) if grid is None else grid, []

    def __call__(self, part):
        self.boxes.append(part)
        return self.grid


@pytest.fixture(scope="module")
def room():
    return grid_of(ROOM)


@pytest.fixture(scope="module")
def office():
    return grid_of(OFFICE, inside=(2.0, 3.0))


def driving(n, start=HERE, step=IDENTITY, segments=ROOM, lidar=LIDAR):
    poses = [start]
    for _ in range(n - 1):
        poses.append(poses[-1] @ step)
    return [(p, noisy(p, k, lidar, segments, t=0.1 * k)) for k, p in enumerate(poses)]


def run(drive, draw, guess=GUESS, reach=math.inf, wheels=True, relocalizer=None):
    """What is returned and at which scan; without wheels the predicted pose stays."""
    relocalizer = relocalizer or Relocalizer()
    start = drive[0][0]
    for k, (pose, scan) in enumerate(drive):
        predicted = guess @ start.between(pose) if wheels else guess
        found = relocalizer.update(scan, predicted, reach, draw)
        if found is not None:
            return found, k, relocalizer
    return None, None, relocalizer


def assert_near(found, truth):
    off = truth.between(found)
    assert math.hypot(off.x, off.y) < 0.1 and abs(off.theta) < 0.05


@pytest.mark.parametrize(("x", "y"), [(3.0, 3.5), (13.0, 3.0), (22.5, 8.2), (8.0, 8.5)])
@pytest.mark.parametrize("wheels", [True, False])
def test_a_robot_put_elsewhere_in_an_office_is_found_while_it_drives(x, y, wheels, office):
    drive = driving(100, Pose2(x, y, 1.0), Pose2(0.02, 0.0, 0.03), OFFICE)
    found, k, _ = run(drive, Map(office), Pose2(10.0, 6.0, -2.0), wheels=wheels)
    assert_near(found, drive[k][0])
    assert all(isinstance(value, float) for value in found)


@pytest.mark.parametrize(
    ("step", "least", "most"),
    [(IDENTITY, 2.0, 4.0), (Pose2(0.0, 0.0, 0.1), 0.0, 2.0), (Pose2(-0.05, 0.02, 0.0), 0.0, 2.0)],
)
def test_a_robot_that_stands_is_found_two_seconds_later_else_earlier(step, least, most, room):
    drive = driving(60, HERE, step)
    found, k, _ = run(drive, Map(room))
    assert_near(found, drive[k][0])
    assert least <= 0.1 * k < most


def test_more_alike_places_than_can_be_tracked_stay_open(monkeypatch):
    of_one = 3.0 * map_index.FIT_COST  # one is tracked, of two
    monkeypatch.setattr(relocalize, "WORK_PER_SCAN", of_one)
    draw, near = Map(grid_of(ALIKE, inside=(0.0, -1.0))), laser(541, range_max=3.0)
    drive = driving(140, Pose2(-4.5, 2.5, -1.5), Pose2(0.0, 0.005, 0.02), ALIKE, near)
    assert run(drive, draw, Pose2(0.0, -1.0, 0.0))[0] is None


def test_tracked_poses_move_by_the_predicted_steps(room):
    drive = driving(40, HERE, Pose2(0.3, 0.0, 0.8))
    found, k, _ = run(drive, Map(room))
    assert_near(found, drive[k][0])
    assert run(drive, Map(room), wheels=False)[0] is None


def test_a_pose_explains_a_scan_by_its_inliers_and_with_few_beams_through_walls(room):
    localizer = GlobalLocalizer(room, min_score=0.6)
    for inliers, conflicts, expected in (
        (0.65, 0.04, True),
        (0.65, 0.06, False),
        (0.9, 0.09, True),
        (0.9, 0.11, False),
    ):
        assert localizer.accepts(Candidate(HERE, inliers, conflicts)) is expected


def test_a_place_out_of_reach_is_not_returned(room):
    away = math.hypot(HERE.x - GUESS.x, HERE.y - GUESS.y)
    for reach in (0.0, 0.5, 0.8 * away):
        assert run(driving(40), Map(room), reach=reach)[0] is None
    assert_near(run(driving(40), Map(room), reach=away + 0.1)[0], HERE)


def test_the_part_around_the_predicted_pose_is_drawn_once_for_a_search(room):
    for reach, half in ((0.0, 8.0), (3.0, 11.0), (50.0, 20.0), (math.inf, 20.0)):
        draw = Map(room)
        run(driving(30, HERE, Pose2(0.0, 0.0, 0.1)), draw, Pose2(-2.0, 1.0, 0.0), reach)
        assert draw.boxes[0] == Box(-2.0 - half, 1.0 - half, -2.0 + half, 1.0 + half)
    assert len(draw.boxes) == 1


def test_pieces_give_what_all_at_once_gives(room):
    whole, pieces, scan = MapIndex(room), MapIndex(room), noisy(HERE)
    while not pieces.prepare(Work(777.0)):
        pass
    search, scans = Search(pieces, scan), 1
    while not search.advance(Work(300.0)):
        scans += 1
    assert scans > 5
    assert merged([], search.found) == searched(whole, scan)
    assert pieces.tiles == whole.tiles


def test_a_piece_that_costs_more_than_there_is_comes_first_and_alone():
    for costs, done in (
        ((2.0, 3.0, 5.0), [True, True, True]),
        ((2.0, 9.0), [True, False]),
        ((11.0, 1.0), [True, False]),
    ):
        work = Work(10.0)
        assert [work.take(cost) for cost in costs] == done


def cells_made(monkeypatch):
    """Sizes of the maps of which a property was worked out from now on."""
    made = []
    for name in ("gap", "distances"):
        prop = getattr(DistanceMap, name)

        def counted(distances, prop=prop):
            if prop.attrname not in distances.__dict__:
                made.append(distances.free.size)
            return prop.__get__(distances)

        monkeypatch.setattr(DistanceMap, name, property(counted))
    return made


def test_the_work_of_a_scan_is_bounded_on_a_large_map(monkeypatch):
    rng = np.random.default_rng(1)
    pillars = [box(x, y, x + 0.3, y + 0.3) for x, y in rng.uniform(1.0, 38.0, (60, 2)).tolist()]
    hall = np.array([*box(0.0, 0.0, 39.5, 39.5), *[side for pillar in pillars for side in pillar]])
    draw, spent = Map(grid_of(hall, inside=(0.5, 0.5))), []
    looked, lookups = Search._search_tile, []
    monkeypatch.setattr(Search, "_search_tile", lambda *a: (looked(*a), lookups.append(a[0]._cost)))
    fits, cells = calls(monkeypatch, DistanceMap, "fit"), cells_made(monkeypatch)
    assert draw.grid.p.size > 650_000
    relocalizer, pose = Relocalizer(), Pose2(20.1, 18.2, 0.5)
    found = None
    while found is None and len(spent) < 120:
        pose = pose @ Pose2(0.0, 0.0, 0.03)
        scan = scan_at(pose, laser(181), hall, t=0.1 * len(spent))
        found = relocalizer.update(scan, Pose2(19.0, 19.0, 0.0), math.inf, draw)
        costs = sum(lookups), len(fits) * map_index.FIT_COST, sum(cells) * map_index.CELL_COST
        spent.append(costs)
        for made in (lookups, fits, cells):
            made.clear()
    assert_near(found, pose)
    assert len(spent) > 15
    assert (np.max(spent, axis=0) > 0.5 * relocalize.WORK_PER_SCAN).all()
    assert np.sum(spent, axis=1).max() < 1.5 * relocalize.WORK_PER_SCAN  # a first square is a guess


def test_a_fine_map_is_made_coarser_and_the_robot_found(monkeypatch):
    monkeypatch.setattr(relocalize, "MAX_SEARCH_CELLS", 13_000)
    grid = grid_of(ROOM, cell=0.025)
    small = coarsened(grid)
    assert small.p.size <= 13_000 and small.resolution == pytest.approx(0.1)
    assert small.p[0, 0] != small.p[0, 0] and np.nanmax(small.p) == 1.0
    for iy, ix in np.ndindex(small.p.shape):
        block = grid.p[4 * iy : 4 * iy + 4, 4 * ix : 4 * ix + 4]
        known = block[~np.isnan(block)]
        expected = known.max() if len(known) else np.nan
        assert small.p[iy, ix] == pytest.approx(expected, nan_ok=True)
    drive = driving(60, HERE, Pose2(0.0, 0.0, 0.03))
    found, k, _ = run(drive, Map(grid))
    assert_near(found, drive[k][0])


@pytest.mark.parametrize(
    "p",
    [np.zeros((9, 9)), np.ones((9, 9)), np.full((9, 9), np.nan), np.zeros((0, 0)), np.ones((1, 1))],
)
def test_a_map_without_walls_or_without_anything_gives_nothing(p):
    draw = Map(OccupancyGrid(p.astype(np.float32), 0.05, (0.0, 0.0)))
    assert run(driving(20), draw)[0] is None and len(draw.boxes) >= 2
    assert run(driving(20), lambda part: None)[0] is None


def test_a_room_that_the_map_does_not_have_is_searched_ever_more_seldom(room):
    elsewhere = np.array([*ROOM[:1], (-2.0, 1.0, 3.0, 2.0), (3.0, 2.0, 4.0, -3.0)])
    times, draw = [], Map(room)
    relocalizer = Relocalizer()
    for k in range(400):
        scan = noisy(IDENTITY, k, segments=elsewhere, t=0.1 * k)
        drawn = len(draw.boxes)
        assert relocalizer.update(scan, GUESS, math.inf, draw) is None
        times += [scan.t] * (len(draw.boxes) - drawn)
    pauses = np.diff(times)
    assert len(times) == 8 and (np.diff(pauses[:5]) > 0.3).all()
    assert pauses[-1] == pytest.approx(8.0, abs=1.0)


def test_a_scan_with_few_valid_beams_waits_and_motion_goes_on(room):
    drive = driving(60, HERE, Pose2(0.0, 0.0, 0.05))
    dark = np.full(541, np.nan, np.float32)
    dark[::30] = 2.0
    assert len(end_points(Scan(0.0, dark, LIDAR))) < 20
    mixed = [
        (pose, Scan(scan.t, dark, LIDAR) if k % 3 else scan) for k, (pose, scan) in enumerate(drive)
    ]
    found, k, _ = run(mixed, Map(room))
    assert k % 3 == 0
    assert_near(found, mixed[k][0])
    draw = Map(room)
    assert run([(HERE, Scan(0.1 * k, dark, LIDAR)) for k in range(20)], draw)[0] is None
    assert draw.boxes == []


def test_odd_scans_poses_and_reaches_do_no_harm(room):
    relocalizer, draw = Relocalizer(), Map(room)
    for scan in odd_scans().values():
        for predicted in (GUESS, Pose2(math.nan, 0.0, 0.0), Pose2(0.0, math.inf, 0.0)):
            for reach in (1.0, math.inf, math.nan, -1.0):
                relocalizer.update(scan, predicted, reach, draw)
    nan = Scan(math.nan, noisy(HERE).ranges, LIDAR)
    assert relocalizer.update(nan, GUESS, math.inf, draw) is None
    relocalizer.reset()
    assert_near(run(driving(60), draw, relocalizer=relocalizer)[0], HERE)


def test_after_a_reset_a_search_begins_anew(room):
    draw, relocalizer = Map(room), Relocalizer()
    assert run(driving(10), draw, relocalizer=relocalizer)[0] is None
    relocalizer.reset()
    other = [(pose, Scan(scan.t + 1.0, scan.ranges, LIDAR)) for pose, scan in driving(40)]
    assert run(other, draw, relocalizer=relocalizer)[0] is not None
    assert len(draw.boxes) == 2
    assert run(other, draw, relocalizer=relocalizer)[0] is not None
    assert len(draw.boxes) == 3


def test_the_same_input_gives_the_same_output_also_from_a_saved_state(room):
    drive, begun = driving(60, HERE, Pose2(0.02, 0.0, 0.03)), Relocalizer()
    first, second = (run(drive, Map(room)) for _ in range(2))
    assert first[:2] == second[:2] and first[0] is not None
    assert run(drive[:9], Map(room), relocalizer=begun)[0] is None
    guess = GUESS @ drive[0][0].between(drive[9][0])
    found, k, _ = run(drive[9:], Map(room), guess, relocalizer=copied(begun))
    assert found == pytest.approx(first[0]) and k + 9 == first[1]
