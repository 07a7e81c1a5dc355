"""Wheels, stamps and single matches in the front end."""

import math

import numpy as np
import pytest

from slams.frontend import update_kernels
from slams.frontend.degeneracy import FULLY_OBSERVED
from slams.frontend.estimator import MAX_UNMATCHED_TIME
from slams.frontend.filter_kernels import DRIFT, N
from slams.frontend.motion_filter import MotionFilter
from slams.frontend.params import FrontendParams
from slams.frontend.plain import PlainEstimator
from slams.frontend.ranking import Candidate
from slams.frontend.wheels import WheelSteps
from slams.refine.lines import Match
from slams.types import IDENTITY, Pose2
from tests.rooms import LIDAR, scan_at, settled
from tests.slams.frontend.test_filter import SHARP, scan
from tests.slams.frontend.test_parts import Standing


def steps(poses, dt=0.1):
    wheels = WheelSteps()
    return [wheels.take(pose, dt) for pose in poses]


@pytest.mark.parametrize(("scans", "first"), [(1, 1), (4, 40)])
def test_each_message_of_the_wheels_but_the_first_brings_one_increment(scans, first):
    found = steps([Pose2(0.05 * scans * (k // scans), 0.0, 0.0) for k in range(first + 10 * scans)])
    brought = [step for step in found[first:] if step is not None]
    assert found[0] is None
    assert [step.increment.x for step in brought] == pytest.approx([0.05 * scans] * 10)
    assert [step.seconds for step in brought] == pytest.approx([0.1 * scans] * 10)


def test_a_robot_at_rest_measures_that():
    moving = [Pose2(0.05 * k, 0.0, 0.0) for k in range(20)]
    resting = steps(moving + [moving[-1]] * 20)[20:]
    assert all(step is not None and step.increment == IDENTITY for step in resting)


@pytest.mark.parametrize("jump", [Pose2(2.0, 0.0, 0.0), Pose2(0.0, 0.0, 1.0)])
def test_what_no_robot_can_do_is_a_reset_of_the_odometry(jump):
    poses = [Pose2(0.05 * k, 0.0, 0.0) for k in range(20)]
    found = steps(poses[:10] + [jump @ pose for pose in poses[10:]])
    assert found[10] is None
    assert found[11].increment.x == pytest.approx(0.05)


def test_an_odometry_that_was_not_there_is_begun_anew():
    found = steps([Pose2(x, 0.0, 0.0) if x else None for x in (0.1, 0.3, None, 1.0, 1.05, 1.2)])
    assert found[3] is None and found[4].rate_change == IDENTITY != found[5].rate_change


def test_the_drift_of_the_heading_is_learned_from_matches():
    motion, drift = MotionFilter(FrontendParams()), 0.05  # rad/m
    wheels = Pose2(0.0, 0.0, 0.0)
    for k in range(300):
        wheels @= Pose2(0.05, 0.0, 0.05 * drift)
        motion.predict(scan(0.1 * k, wheels))
        motion.update(Pose2(0.05 * k, 0.0, 0.0), SHARP, FULLY_OBSERVED)
    assert motion._z[DRIFT] == pytest.approx(drift, rel=0.2)


def test_of_a_match_whose_stamp_jitters_the_state_takes_its_share():
    z, P, out = np.zeros(N), np.diag(np.full(N, 1e-4)), np.empty(3)
    match = np.array((0.1, -0.2, 0.05))
    for error, share in ((0.0, 1.0), (1e-4, 0.5), (1e-2, 1.0 / 101.0)):
        update_kernels.pose_at_stamp(z, P, match, np.full(3, error), out)
        assert out == pytest.approx(share * match)


def test_late_stamps_widen_the_prior_by_the_distance_driven_meanwhile():
    rng, wide = np.random.default_rng(3), []
    for jitter in (0.0, 0.03):
        motion = MotionFilter(FrontendParams())
        for k in range(100):
            pose = Pose2(0.05 * k, 0.0, 0.0)
            prior = motion.predict(scan(0.1 * k + jitter * rng.uniform(), pose))
            motion.update(pose, SHARP, FULLY_OBSERVED)
        wide.append(np.sqrt(np.diag(prior.covariance)))
    assert wide[1][0] > 1.3 * wide[0][0]  # half a meter a second, 9 ms
    assert wide[1][1] == pytest.approx(wide[0][1], rel=0.3)


def test_against_wheels_a_good_match_is_taken_only_where_a_robot_gets_in_half_a_second():
    for turn, state in ((0.35, "matched"), (1.3, "predicted")):
        slam = settled("hector", 30, odometry=IDENTITY)
        turned = Pose2(0.0, 0.0, turn)  # wheels that slipped, once
        for k in range(30, 35):
            pose = slam.update(scan_at(turned, LIDAR, t=0.1 * k, odometry=IDENTITY))
            assert slam.state == state
        assert pose == pytest.approx(turned if state == "matched" else IDENTITY, abs=0.02)


def test_a_score_is_that_of_scan_and_prior():
    near, far = (Candidate(Match(IDENTITY), square, 0.0, 0.8, 0.1) for square in (0.0, 400.0))
    assert near.score == near.match_score == pytest.approx(0.7)
    assert far.match_score == near.match_score and far.score < near.score - 0.1


@pytest.mark.parametrize(
    ("shares", "maps", "later"),
    [((0.0, 0.22), True, 0.22), ((0.05, 0.28), False, 0.28), ((0.05, 0.45), False, 0.2)],
)
def test_where_nothing_matches_new_ground_enters_the_map(shares, maps, later):
    robot = Standing(5)
    for k in range(1, 16):
        found, seconds = robot.take(1, shares[0], later if k > 9 else shares[1]), 0.1 * k
        if abs(seconds - MAX_UNMATCHED_TIME) > 0.05:
            assert found.may_map == (maps and seconds > MAX_UNMATCHED_TIME)


def test_the_start_is_the_last_pose_moved_by_the_wheels():
    for seconds, turn in ((0.2, 0.1), (0.01, 0.0)):  # stamps that jitter make no jump of a step
        estimator = PlainEstimator(FrontendParams())
        estimator.predict(scan(0.0, Pose2(5.0, 0.0, math.pi / 2)))
        prior = estimator.predict(scan(seconds, Pose2(5.0, 0.3, math.pi / 2 + turn)))
        assert prior.pose == pytest.approx((0.3, 0.0, turn))
        assert not prior.information.any()


@pytest.mark.parametrize("wrong", [Pose2(0.1, 0.0, 1.5), Pose2(-40.0, 0.0, 0.0)])
def test_wheels_that_jump_are_not_followed(wrong):
    """The driver restarted, or a message is broken: the last step is repeated."""
    estimator = PlainEstimator(FrontendParams(), motion_model=True)
    estimator.predict(scan(0.0, Pose2(0.0, 0.0, 0.0)))
    before = estimator.predict(scan(0.2, Pose2(0.1, 0.0, 0.0)))
    after = estimator.predict(scan(0.4, Pose2(0.1, 0.0, 0.0) @ wrong))
    assert after.pose == pytest.approx((0.2, 0.0, 0.0))
    assert after.information[2, 2] < before.information[2, 2]
    assert estimator.counts["odometry"] == 1
