"""What a search in a map is made of: steps of a fit, when to search again, what counts as one."""

import math

import numpy as np
import pytest

from slams.localize import Candidate, GlobalLocalizer, Localizer, MapIndex, global_localizer
from slams.localize.distance_kernels import FIT_DAMPING, MAX_FIT_ROTATION, fit, normal_equations
from slams.localize.distance_map import DistanceMap
from slams.localize.global_localizer import SEARCH_TIME
from slams.localize.map_index import SCORE_TOLERANCE, is_same, merged
from slams.localize.virtual import stations
from slams.types import IDENTITY, Pose2
from tests.floors import grid_of
from tests.rooms import LIDAR, ROOM, box, laser, scan_at, still
from tests.wheels import Drifting

HERE, THERE = Pose2(0.0, 0.0, 0.0), Pose2(5.0, 1.0, 0.0)


class Guide(MapIndex):
    """An index that takes every pose for right, `drift` further on; it counts the searches."""

    def __init__(self, *poses, drift=IDENTITY, score=0.9):
        self.poses, self.drift, self.score, self.searches = poses, drift, score, 0

    def prepare(self, work):
        return True

    def match(self, scan, poses):
        return [Candidate(pose @ self.drift, self.score, 0.0) for pose in poses]


class Guided:
    """A search that finds the poses of a guide."""

    def __init__(self, guide, scan):
        guide.searches += 1
        self.found = [Candidate(pose, guide.score, 0.0) for pose in guide.poses]

    def advance(self, work):
        return True


@pytest.fixture
def guided(monkeypatch):
    monkeypatch.setattr(global_localizer, "Search", Guided)


def test_one_step_of_a_fit_is_damped_and_limited():
    distances, pose = DistanceMap(grid_of(ROOM)), Pose2(1.0, 0.5, 0.0)
    ends = scan_at(pose, LIDAR).ranges[:, None] * LIDAR.directions
    for off, soft in ((Pose2(0.1, 0.08, 0.0), 0.2), (Pose2(0.0, 0.0, 0.15), 2.0)):
        start = distances.in_cells(pose @ off)
        moved = start.copy()
        fit(distances.distances, ends / distances.resolution, np.array([soft]), 1, moved)
        steps = np.abs(moved - start)
        assert (steps[:2] <= 1.0001 * soft).all() and steps[2] <= 1.0001 * MAX_FIT_ROTATION
        assert steps[2] == pytest.approx(MAX_FIT_ROTATION) or steps[:2].max() == pytest.approx(soft)
    H, b, start = np.zeros((3, 3)), np.zeros(3), distances.in_cells(pose @ Pose2(0.01, 0.0, 2e-3))
    moved, points = start.copy(), ends / distances.resolution
    fit(distances.distances, points, np.array([9.0]), 1, moved)
    normal_equations(distances.distances, points, 9.0, start, H, b)
    damped = H + (FIT_DAMPING - 1.0) * np.diag(np.diag(H))
    assert moved - start == pytest.approx(np.linalg.solve(damped, b), rel=1e-6)


@pytest.mark.parametrize(
    ("odometry", "searches"),
    [
        (Pose2(0.29, 0.0, 0.0), 1),
        (Pose2(0.25, 0.25, 0.0), 2),
        (Pose2(0.0, 0.0, 0.29), 1),
        (Pose2(0.0, 0.0, -0.31), 2),
    ],
)
def test_the_map_is_searched_again_after_a_way_or_a_turn(guided, odometry, searches):
    guide = Guide(HERE, THERE)
    localizer = GlobalLocalizer(guide)
    for k, pose in enumerate((IDENTITY, odometry)):
        assert localizer.add(still(k, odometry=pose)) is None
    assert guide.searches == searches


@pytest.mark.parametrize(("score", "searches"), [(0.9, 1), (0.4, 2)])
def test_at_a_standstill_only_an_unexplained_scan_starts_a_search(guided, score, searches):
    guide = Guide(HERE, THERE, score=score)
    localizer = GlobalLocalizer(guide)
    for t in (0.0, 0.5 * SEARCH_TIME, 0.95 * SEARCH_TIME):
        localizer.add(still(10.0 * t))
    assert guide.searches == 1
    for t in (1.01 * SEARCH_TIME, 1.5 * SEARCH_TIME):
        localizer.add(still(10.0 * t))
        assert guide.searches == searches


def test_candidates_move_by_the_wheels_and_without_them_by_their_last_step(guided):
    step = Pose2(0.1, 0.0, 0.05)
    for wheels, moved in ((True, step), (False, IDENTITY)):
        localizer = GlobalLocalizer(Guide(HERE, THERE))
        for k in range(2):
            localizer.add(still(k, odometry=Pose2(*(k * v for v in step)) if wheels else None))
        assert [c.pose for c in localizer.candidates] == [HERE @ moved, THERE @ moved]
    localizer = GlobalLocalizer(Guide(HERE, THERE, drift=Pose2(0.1, 0.0, 0.0)))
    for k in range(3):
        localizer.add(still(k))
    assert localizer.candidates[0].pose.x == pytest.approx(0.1 + 0.2)


def test_probabilities_stay_between_searches_and_count_in_the_next(guided):
    guide = Guide(HERE, THERE)
    localizer = GlobalLocalizer(guide)
    localizer.add(still(0, odometry=IDENTITY))
    here, there = localizer.candidates
    localizer.candidates = [here._replace(probability=0.8), there._replace(probability=0.2)]
    localizer.add(still(1, odometry=IDENTITY))
    assert [c.probability for c in localizer.candidates] == [0.8, 0.2]
    guide.poses = (HERE, THERE, Pose2(9.0, 9.0, 0.0))
    localizer.add(still(2, odometry=Pose2(0.4, 0.0, 0.0)))
    expected = np.array([0.8, 0.2, 0.01]) / 1.01
    assert [c.probability for c in localizer.candidates] == pytest.approx(expected)


def test_a_pose_that_the_map_does_not_explain_is_not_found_however_alone(guided):
    for score, failed in ((0.9, False), (0.4, True)):
        localizer = GlobalLocalizer(Guide(HERE, score=score))
        assert (localizer.add(still(0)) is None) == failed == localizer.failed
        assert [c.pose for c in localizer.candidates] == [HERE]


def test_the_probability_of_candidates_left_out_is_that_of_others():
    every = [Candidate(Pose2(float(x), 0.0, 0.0), 0.9, 0.0) for x in range(10)]
    kept = merged([], every)[:2]
    assert merged(kept, every[2:3])[0].pose == every[2].pose
    assert max(c.probability for c in merged(kept, every)) < 0.2


def test_one_place_is_within_half_a_meter_and_fifteen_degrees():
    for other, same in (
        (Pose2(0.3, 0.3, 0.2), True),
        (Pose2(0.4, 0.4, 0.0), False),
        (Pose2(0.0, 0.0, 0.3), False),
        (Pose2(0.0, 0.0, -0.3), False),
        (Pose2(0.0, 0.0, 6.2), True),
    ):
        assert is_same(HERE, other) == same


def test_a_tie_is_as_good_and_beyond_it_probabilities_fall():
    def probable(less):
        return merged([], [Candidate(HERE, 0.9, 0.0), Candidate(THERE, 0.9 - less, 0.0)])

    assert [c.probability for c in probable(0.9 * SCORE_TOLERANCE)] == pytest.approx([0.5, 0.5])
    first, second = probable(SCORE_TOLERANCE + 0.02)
    assert second.probability / first.probability == pytest.approx(math.exp(-30.0 * 0.02))


def test_what_the_map_explains_is_seen_from_the_laser():
    lidar, pose = laser(361, mount=Pose2(0.5, 0.2, 2.0)), Pose2(1.0, 0.5, 0.3)
    localizer = Localizer(Drifting(None), MapIndex(grid_of(ROOM)), pose)
    assert localizer.update(scan_at(pose, lidar)) == pose
    assert localizer.explained > 0.95


def test_walls_farther_than_a_meter_do_not_pull():
    distances = DistanceMap(grid_of(ROOM))
    assert distances.distances.wall.max() == pytest.approx(1.0 / distances.resolution)


def test_a_virtual_drive_goes_from_place_to_place_without_jumps():
    places = stations(DistanceMap(grid_of(np.array(box(0.0, 0.0, 8.0, 5.0)), inside=(1.0, 1.0))))
    assert np.hypot(*np.diff(places, axis=0).T).max() < 2.0
