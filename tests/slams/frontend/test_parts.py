"""Timing, degeneracy, correlative matching, keyframes and the estimator, by synthetic cases."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slams.frontend.correlative import (
    LikelihoodField,
    Window,
    pooled_field,
    search,
    window_of,
)
from slams.frontend.degeneracy import FULLY_OBSERVED, match_observability, observability
from slams.frontend.estimator import PoseEstimator
from slams.frontend.keyframes import Keyframes
from slams.frontend.motion_filter import Prediction
from slams.frontend.params import FrontendParams
from slams.frontend.plain import estimator_for
from slams.frontend.ranking import best_around
from slams.frontend.timing import LaserTimings, ScanTiming
from slams.loops.matching import LocalMap, keyframe
from slams.refine.lines import Match
from slams.scan.end_points import EndPoints, pose_distance
from slams.scan.params import ScanParams
from slams.types import IDENTITY, Pose2
from tests.rooms import CORRIDOR, LIDAR, ROOM, laser, scan_at

UNIFORM = LikelihoodField(np.ones((200, 200), np.float32), -20.0, -20.0, 0.2)


def intervals(stamps, **how):
    timing = ScanTiming(**how)
    return np.array([timing.elapsed(float(t)) for t in stamps])[1:]


@pytest.mark.parametrize("seed", range(5))
def test_stamps_that_jitter_are_filtered(seed):
    rng = np.random.default_rng(seed)
    stamps = 0.2 * np.arange(400) + rng.uniform(0.0, 0.3, 400)
    filtered, raw = intervals(stamps), intervals(stamps, smooth=False)
    assert np.std(filtered[100:]) < 0.5 * np.std(raw[100:])
    assert np.mean(filtered[100:]) == pytest.approx(0.2, rel=0.1)


@pytest.mark.parametrize("seed", range(5))
def test_keyframes_come_when_the_robot_has_driven_on_and_do_not_jitter(seed):
    timing = ScanTiming()
    for k, t in enumerate(np.cumsum(np.random.default_rng(seed).lognormal(0.7, 0.6, 300))):
        timing.elapsed(t)
        assert timing.jitter == 0.0 or k < 10


def test_scans_that_are_missing_leave_their_time():
    whole = np.random.default_rng(0).choice((1, 2, 3), 300)
    found = intervals(0.08 * np.cumsum(whole))
    assert np.corrcoef(found[50:], whole[51:])[0, 1] > 0.95


def test_steady_stamps_and_a_gap_are_kept_and_stamps_that_go_back_give_an_interval():
    stamps = np.concatenate([0.1 * np.arange(50), 0.1 * np.arange(50) + 8.0])
    assert intervals(stamps)[:50] == pytest.approx([0.1] * 49 + [3.1], abs=1e-9)
    assert (intervals((0.0, 0.1, 0.2, 0.1, 0.3)) > 0.0).all()


@pytest.mark.parametrize("first", [0.001, -0.2, 0.1, 3.0])
def test_the_first_interval_and_a_clock_that_is_set_back_are_no_jitter(first):
    timing, stamps = ScanTiming(), np.concatenate([[-first], 0.1 * np.arange(200)])
    stamps += np.random.default_rng(0).uniform(0.0, 0.01, len(stamps))
    for t in (*stamps, *(stamps[1:] - 30.0)):
        timing.elapsed(float(t))
        assert timing.jitter < 0.01 or first == 3.0
    assert timing.interval == pytest.approx(0.1, rel=0.05) and timing.jitter > 0.001


@pytest.mark.parametrize(("along", "share"), [(0.002, 0.8), (0.0003, 0.0), (0.1, 1.0)])
def test_errors_of_the_normals_of_a_map_give_no_information(along, share):
    seen = match_observability(1e6 * np.diag((along, 1.0, 1.0)))
    assert seen.share == pytest.approx(share) and (share == 1.0 or abs(seen.x) > 0.999999)
    assert match_observability(np.zeros((3, 3))) == FULLY_OBSERVED  # no beam: nothing to take out


def test_a_corridor_is_degenerate_along_itself_and_a_room_is_not():
    seen = observability(200.0 * math.sin(0.3) ** 2, -200.0 * math.sin(0.3) * math.cos(0.3),
                         200.0 * math.cos(0.3) ** 2, 0.14)  # fmt: skip
    assert seen.share == 0.0
    assert abs(seen.x * math.cos(0.3) + seen.y * math.sin(0.3)) == pytest.approx(1.0)
    assert observability(100.0, 0.0, 100.0, 0.14) == FULLY_OBSERVED
    assert 0.0 < observability(8.0, 0.0, 200.0, 0.14).share < 0.9
    assert observability(2.0, 0.0, 150.0, 0.14).share == 0.0
    # with smaller errors of the normals more is observed
    assert observability(2.0, 0.0, 150.0, 0.05).share > 0.3


def test_a_search_finds_the_pose_that_the_wall_shows():
    likelihood = np.zeros((60, 60), np.float32)
    likelihood[40, 10:50] = likelihood[10:40, 50] = 1.0
    walls = np.argwhere(likelihood > 0.0)[:, ::-1] * 0.1
    true = Pose2(2.0, 2.0, 0.2)
    points = true.inverse().transform(walls).T
    lookup = LikelihoodField(likelihood, 0.0, 0.0, 0.1)
    window = window_of(Pose2(2.5, 1.7, 0.0), np.diag((0.04, 0.04, 0.01)))
    poses, _ = search(lookup, points, window, tolerance=0.2)
    assert (np.diff(poses[:, 3]) <= 0.0).all() and poses[0, 2] == pytest.approx(0.2, abs=0.05)
    assert math.hypot(poses[0, 0] - 2.0, poses[0, 1] - 2.0) < 0.11
    every, _ = search(lookup, points, window, tolerance=1.0)
    assert every[0] == pytest.approx(poses[0])
    # poses below the tolerance were not evaluated to the end
    assert (every[:, 3] >= poses[:, 3]).all() and every[:, 3].sum() > poses[:, 3].sum() + 1.0
    hits = lookup._replace(likelihood=4.0 * likelihood, full=3.0)
    np.testing.assert_array_equal(search(hits, points, window)[0], every)


def test_a_search_does_bounded_work():
    lookup = LikelihoodField(np.ones((400, 400), np.float32), 0.0, 0.0, 0.2)
    ends = np.random.default_rng(0).uniform(10.0, 50.0, (3, 4000))
    window = window_of(Pose2(0.0, 0.0, 0.0), np.diag((100.0, 100.0, 100.0)))
    poses, lookups = search(lookup, ends, window)
    assert len(poses) > 0 and 0 < lookups <= 1_500_000  # 5 ms


@pytest.mark.parametrize("block", [4, 8])
def test_a_coarse_cell_bounds_all_shifts_within_it(block):
    fine = np.random.default_rng(block).random((64, 80), np.float32)
    found = pooled_field(LikelihoodField(fine, 1.0, 2.0, 0.1), block)
    assert (found.x0, found.y0) == pytest.approx((1.0 - 0.1 * block, 2.0 - 0.1 * block))
    for iy in range(64):
        for ix in range(80):
            most = fine[iy : iy + block, ix : ix + block].max()
            assert found.pooled[iy + block, ix + block] == most


@pytest.mark.parametrize("half", [0.05, 0.4, 1.0, 2.0, 4.0])
def test_a_search_stays_in_its_window(half):
    """But for one coarse cell of it: walls beside it are not to crowd out what is inside."""
    poses, _ = search(UNIFORM, np.ones((2, 60)), Window(IDENTITY, half, 0.1), tolerance=1.0)
    found = np.abs(poses[:, :2]).max()
    assert 0.9 * half - 0.2 < found < half + max(0.2, 0.8 * half)


PRIOR = Prediction(IDENTITY, 400.0 * np.eye(3), np.eye(3) / 400.0, IDENTITY, 0.1)


class Map:
    """A map that is searched by a lookup, and explains a share of a scan."""

    def __init__(self, lookup, share):
        self.likelihood_field, self.evaluate = lambda: lookup, lambda *at: (share(*at), 0.0)


def here():
    return EndPoints(ScanParams()).read(scan_at(IDENTITY, LIDAR), IDENTITY)


def test_where_all_is_alike_a_search_looks_near_the_prior():
    uniform = Map(UNIFORM, lambda *_: 0.5)

    def rematch(points, start, prior):
        starts.append(start)
        return [Match(start)]

    starts = []
    best = best_around(Match(Pose2(0.3, 0.0, 0.0)), here(), uniform, PRIOR, rematch)
    distances = [round(PRIOR.mahalanobis_squared(start), 9) for start in starts]
    assert distances == sorted(distances) and distances[0] == 0.0
    assert best.match.pose == starts[0]


@pytest.mark.parametrize(
    ("lateral", "rotation", "found"),
    [(0.0, 0.5, True), (0.0, 0.9, True), (0.0, 1.3, False), (0.8, 0.0, True), (2.2, 0.0, False)],
)
def test_a_search_reaches_as_far_as_a_late_scan_may_be(lateral, rotation, found):
    """However small the covariance of the prior: here 5 cm and a twentieth of a radian."""
    true = Pose2(lateral, 0.0, rotation)
    lookup = LocalMap([keyframe(scan_at(IDENTITY, LIDAR), IDENTITY)], [true])._field
    walls = Map(lookup, lambda *at: 1.0 if pose_distance(*at, true) < 0.3 else 0.1)
    best = best_around(Match(IDENTITY), here(), walls, PRIOR, lambda _, start, __: [Match(start)])
    assert (pose_distance(here(), best.match.pose, true) < 0.3) == found


def test_a_window_far_from_all_that_is_mapped_has_no_likely_pose():
    lookup = LikelihoodField(np.ones((9, 9), np.float32), 0.0, 0.0, 0.2)
    window = window_of(Pose2(500.0, -500.0, 0.0), np.eye(3))
    poses, _ = search(lookup, np.ones((2, 50)), window)
    assert (poses[:, 3] == 0.0).all()


def test_keyframes_come_by_distance_rotation_and_quality():
    keyframes = Keyframes(0.25, 0.3, 2)
    here = Pose2(0.0, 0.0, 0.0)
    assert keyframes.due(here, 1.0, here)
    keyframes.add(here, 1.0)
    assert keyframes.due(here, 1.0, here)
    keyframes.add(here, 1.0)
    assert not keyframes.due(Pose2(0.2, 0.0, 0.2), 0.9, here)
    assert keyframes.due(Pose2(0.3, 0.0, 0.0), 1.0, here)
    assert keyframes.due(Pose2(0.0, 0.0, 0.4), 1.0, here)
    assert keyframes.due(here, 0.8, here)


def test_each_laser_has_keyframes_of_its_own():
    keyframes, here, rear = Keyframes(0.25, 0.3, 1), Pose2(0.0, 0.0, 0.0), Pose2(-0.2, 0.0, 3.1)
    assert keyframes.due(here, 1.0, here)
    keyframes.add(here, 1.0)
    assert keyframes.due(here, 0.5, rear)
    keyframes.add(here, 0.5)
    assert not keyframes.due(here, 1.0, here) and not keyframes.due(here, 0.5, rear)


def test_two_lasers_in_turns_are_no_jitter():
    timings, mounts = LaserTimings(), (Pose2(0.2, 0.0, 0.0), Pose2(-0.2, 0.0, 3.1))
    stamps = np.sort(np.concatenate([0.2 * np.arange(60), 0.2 * np.arange(60) + 0.03]))
    found = [timings.elapsed(t, mounts[i % 2]) for i, t in enumerate(stamps)]
    assert np.allclose(found[1:], np.diff(stamps)) and timings.jitter < 1e-6


@pytest.mark.parametrize("seed", range(4))
def test_a_gap_among_stamps_that_jitter_is_kept(seed):
    stamps = 0.2 * np.arange(200) + np.random.default_rng(seed).uniform(0.0, 0.1, 200)
    stamps[150:] += 3.0
    assert intervals(stamps)[149] == pytest.approx(stamps[150] - stamps[149])


class Standing:
    """A robot at rest, with a map whose shares of inliers and conflicts are given.

    It starts with `explained` scans that match entirely.
    """

    empty = False

    def __init__(self, explained, wheels=True, walls=ROOM):
        self._wheels, self._k, self._walls = IDENTITY if wheels else None, 0, walls
        self._reader = EndPoints(ScanParams())
        self.estimator = PoseEstimator(FrontendParams(search=False, relocate=False))
        self.predicted = None  # shares at the predicted pose, if not those of the match
        self.take(explained, 1.0, 0.0)

    def evaluate(self, points, pose):
        return self.shares if self.predicted is None or pose != IDENTITY else self.predicted

    def crop(self, box):
        return None

    def take(self, count, inliers, conflicts, pose=IDENTITY, information=(1e5, 1e5, 1e6)):
        """Update with `count` scans, each with a match at `pose` with `information`."""
        self.shares = inliers, conflicts
        for _ in range(count):
            scan = scan_at(IDENTITY, LIDAR, self._walls, t=0.1 * self._k, odometry=self._wheels)
            points = self._reader.read(scan, self.estimator.predict(scan).twist)
            match = Match(pose, information=np.diag(information))
            self.estimator.decide(points, [match], self, lambda *_: [])
            self._k += 1
        return self.estimator


@pytest.mark.parametrize(("wheels", "state"), [(False, "lost"), (True, "predicted")])
def test_a_robot_without_end_points_is_lost_until_it_starts_a_map(wheels, state):
    robot = Standing(0, wheels, walls=np.add(ROOM, 1e3))
    robot.empty = True
    assert robot.take(2, 0.0, 0.0).state == "predicted"
    assert robot.take(20, 0.0, 0.0).state == state
    robot._walls = ROOM
    found = robot.take(1, 0.0, 0.0)
    assert found.state == "matched" and found.covariance.trace() < 1e-6  # in its new map


def test_a_map_drifts_by_its_first_scan_and_where_it_grows():
    robot = Standing(12)
    found, local = robot.estimator, robot.estimator.local_covariance
    assert (found.covariance == local).all()
    found.inserted(settling=True)
    np.testing.assert_allclose(found.covariance, 2.0 * local)
    robot.take(1, 0.5, 0.1)  # 40 % of it in new ground
    drift, local = found.covariance - found.local_covariance, found.local_covariance
    found.inserted(settling=False)
    np.testing.assert_allclose(found.covariance, drift + 1.16 * local)
    drift += 0.16 * local
    found.correct(Pose2(0.0, 10.0, 0.0))  # the heading's error is a lever to the left
    moved = found.covariance - found.local_covariance
    assert moved[0, 0] == pytest.approx(drift[0, 0] - 20.0 * drift[0, 2] + 100.0 * drift[2, 2])
    assert moved[1, 1] == pytest.approx(drift[1, 1]) and moved[0, 2] < drift[0, 2]


@pytest.mark.parametrize("far", [False, True])
def test_along_a_bare_corridor_a_match_beyond_the_gate_is_of_this_interval(far):
    """A tenth of a second; a wall across may be the floor that a tilted laser hits."""
    off, turn = Pose2(0.4 if far else 0.15, 0.0, 0.0), Pose2(0.0, 0.0, 0.4)
    closed = np.vstack((CORRIDOR, [[6.0, -1.0, 6.0, 1.0]]))
    for walls, is_taken in (CORRIDOR, not far), (closed, not far), (ROOM, True):
        robot = Standing(19, walls=walls)
        assert (robot.take(1, 1.0, 0.0, off).state == "matched") == is_taken
    assert Standing(19, walls=closed).take(1, 1.0, 0.0, turn).state == "matched"
    post = np.vstack((CORRIDOR, [[4.0, -1.0, 4.0, -0.5]]))  # observes as little by laser alone
    assert Standing(19, wheels=False, walls=post).take(1, 1.0, 0.0, off).match is not None


@pytest.mark.parametrize(
    ("before", "share", "state"),
    [(0, 0.7, "matched"), (0, 0.25, "predicted"), (1, 0.7, "matched"), (1, 0.6, "predicted")],
)
def test_a_robot_may_start_fast_into_new_ground(before, share, state):
    """Its first scans match by less than all, as they are partly in new ground."""
    robot = Standing(0)
    robot.take(before, 0.75, 0.0)
    assert robot.take(1, share, 0.0, Pose2(0.3, 0.0, 0.0)).state == state


@pytest.mark.parametrize(
    ("there", "predicted", "state"),
    [
        ((0.7, 0.2), (0.7, 0.2), "predicted"),  # among people, any pose does as well
        ((0.6, 0.2), (0.4, 0.3), "matched"),
        ((0.25, 0.22), (0.1, 0.5), "predicted"),  # more than the prediction, and yet nothing
        ((0.6, 0.0), (0.6, 0.0), "matched"),  # along a corridor that is empty
    ],
)
def test_a_scan_in_conflict_overrules_the_wheels_only_with_a_lead(there, predicted, state):
    robot = Standing(1)
    robot.predicted = predicted
    found = robot.take(1, *there, Pose2(0.01, 0.0, 0.0), (1e4, 1e4, 1e5))  # 4.4 deviations
    assert found.state == state and (found.pose == IDENTITY) == (state == "predicted")
    again = robot.take(4, *there, Pose2(0.01, 0.0, 0.0), (1e4, 1e4, 1e5))  # the wheels may be wrong
    assert again.state == ("predicted" if there == (0.25, 0.22) else "matched")


def test_wheels_in_conflict_with_the_map_give_way_to_matches_of_most_points():
    robot, at = Standing(19), Pose2(0.05, 0.0, 0.0)
    robot.predicted = 0.0, 0.4
    assert robot.take(1, 0.6, 0.0, at).state == "predicted"
    assert robot.take(8, 0.6, 0.0, at).state == "matched"


@pytest.mark.parametrize(
    ("at", "share", "searched"),
    [
        (Pose2(0.2, 0.0, 0.2), 1.0, False),
        (Pose2(0.3, 0.0, 0.0), 1.0, True),
        (Pose2(0.0, 0.0, -0.3), 1.0, True),
        (IDENTITY, 0.8, True),
    ],
)
def test_a_match_is_searched_for_where_it_is_far_or_scores_less_than_usual(at, share, searched):
    robot = Standing(19, wheels=False)
    robot.estimator._p, robot.likelihood_field = FrontendParams(search=True), lambda: UNIFORM
    assert robot.take(1, share, 0.0, at).counts["searched"] == searched


@pytest.mark.parametrize(("for_it", "against", "x"), [(0.3, 0.29, 0.02), (0.3, 0.31, 0.0)])
def test_inside_the_gate_a_match_is_taken_if_more_beams_are_for_it_than_against(for_it, against, x):
    robot = Standing(19, wheels=False)
    taken = robot.take(1, for_it, against, Pose2(0.02, 0.0, 0.0))
    assert taken.pose.x == pytest.approx(x, abs=0.005)


@pytest.mark.parametrize("usual", [1.0, 0.2])
@pytest.mark.parametrize(("for_it", "taken"), [(0.25, False), (0.35, True)])
def test_a_lost_robot_takes_no_match_that_chance_may_explain(for_it, taken, usual):
    robot = Standing(10, wheels=False)
    robot.take(60, usual, 0.0)
    assert robot.take(20, 0.0, 1.0).state == "lost"
    found = robot.take(1, for_it, 0.0, Pose2(0.1, 0.0, 0.0))
    assert (found.match is not None) == taken


def test_a_match_that_observes_by_errors_of_normals_alone_is_degenerate():
    """The scans observe a room, but the lines of the match have one normal, except for errors."""
    deviation = []
    for along in (300.0, 3000.0):  # of 1e6 across
        found = Standing(0, wheels=False).take(30, 1.0, 0.0, information=(along, 1e6, 1e6))
        deviation.append(math.sqrt(found.covariance[0, 0]))
    assert deviation[0] > 0.3 and deviation[1] < 0.02


@pytest.mark.parametrize(("wheels", "state"), [(False, "lost"), (True, "predicted")])
def test_without_a_match_while_one_has_to_stand_a_robot_without_wheels_is_lost(wheels, state):
    robot = Standing(10, wheels)
    robot.take(40, 0.0, 0.0)  # in new ground
    robot.take(2, 0.5, 0.0)
    assert robot.take(1, 0.0, 0.0).state == state


def test_good_wheels_are_not_overruled_by_one_match_that_fits():
    robot = Standing(19)
    found = robot.take(1, 1.0, 0.0, Pose2(1.0, 0.0, 1.5))
    assert found.state == "predicted"
    assert math.hypot(found.pose.x, found.pose.y) < 0.01
    found = robot.take(50, 1.0, 0.0, Pose2(1.0, 0.0, 1.5))  # but by many
    assert found.pose.x == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(("wheels", "state"), [(True, "predicted"), (False, "lost")])
def test_after_a_contradiction_what_explains_half_has_to_stand_for_seconds(wheels, state):
    """With wheels the robot is not lost meanwhile, as among people."""
    robot = Standing(10, wheels)
    assert robot.take(20, 0.0, 1.0).state == state
    found = robot.take(50, 0.5, 0.0)  # CONFIRMATION_TIME at the mean score: 6 s
    assert found.state == state and not found.may_map
    found = robot.take(20, 0.5, 0.0)
    assert found.state == "matched" and found.may_map
    assert robot.take(35, 0.0, 0.0).may_map  # what was in conflict before the match is over


@pytest.mark.parametrize(("motion_model", "informed"), [(False, False), (True, True)])
def test_a_paper_has_wheels_as_a_prior_only_if_it_has_a_motion_model(motion_model, informed):
    estimator = estimator_for(FrontendParams(estimator="plain"), motion_model)
    lidar, scans = laser(11, time_increment=0.001), []
    for k in range(2):
        scan = scan_at(IDENTITY, lidar, t=0.1 * k, odometry=Pose2(0.1 * k, 0.0, 0.0))
        scans.append(replace(scan, mid_odometry=Pose2(0.02 + 0.12 * k, 0.0, 0.0)))
    estimator.set_pose(scans[0], IDENTITY)
    prior = estimator.predict(scans[1])
    assert prior.pose == pytest.approx(Pose2(0.12, 0.0, 0.0)), "that at the middle of the sweep"
    assert prior.information.any() == informed
