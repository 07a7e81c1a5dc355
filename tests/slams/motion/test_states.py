"""What a track learns from a match or its lack, and when it is held, adrift or unproven."""

import math

import numpy as np
import pytest

from slams.motion.chord import CERTAIN, NOTHING
from slams.motion.model import Motion
from slams.motion.params import MotionParams
from slams.motion.sight import CLEAR
from slams.motion.sight_kernels import N_FACES, faces
from slams.motion.track import (
    FAR,
    FREEDOM,
    INDEPENDENT,
    LOST_AFTER,
    Track,
    _with_the_same_error,
    _without_wheels,
)
from slams.motion.trust import Doubt, Expected, Limits, Scale
from slams.motion.velocity import Velocity, interval
from slams.motion.wheels import Gyro, Wheels, gyro_turn, wheel_step
from slams.types import IDENTITY, Pose2, Scan
from tests.rooms import CORRIDOR, cast, laser

P = MotionParams()
CLUTTER = np.random.default_rng(4).uniform(1.0, 9.0, 400).astype(np.float32)
BEAM = (CLUTTER, laser(400))  # no walls: what is seen is what the matcher says
ROOM = np.diag([1e6, 1e6, 1e7])  # 1/m^2, 1/rad^2
STEP = 0.05  # m in 0.1 s


def stamped(k, wheels=True):
    return Scan(0.1 * k, *BEAM, Pose2(STEP * k, 0.0, 0.0) if wheels else None)


def driven(n=30, wheels=True, **more):
    """A track after `n` scans that were all matched where the robot is."""
    track = Track(P, **more)
    for k in range(n):
        track.predict(stamped(k, wheels))
        track.matched(Pose2(STEP * k, 0.0, 0.0), ROOM, stamped(k, wheels))
    return track


def surprised(track, k, wheels, off=0.3):
    """The track's scale after a match off the prediction."""
    found = track.predict(stamped(k, wheels)).pose
    track.matched(found @ Pose2(off, 0.0, 0.0), ROOM, stamped(k, wheels))
    return track._scale


def test_a_surprise_widens_what_is_expected_but_not_after_a_blind_drive():
    assert surprised(driven(wheels=False), 30, wheels=False) > 1.2
    track = driven(wheels=False)
    track.predict(stamped(30, wheels=False))
    track.missed(stamped(30, wheels=False))
    assert surprised(track, 31, wheels=False) == 1.0


def test_a_surprise_against_the_wheels_counts_only_where_that_was_asked_for():
    for widen in (True, False):
        track = driven(widen_wheels=widen)
        assert (surprised(track, 30, wheels=True) > 1.2) == widen


def test_what_was_widened_narrows_ten_times_as_slowly_and_never_below_what_is_known():
    track = driven(wheels=False)
    track._seconds = 0.1
    widths = []
    for by_scan in (np.full(3, 100.0), np.zeros(3)):
        track._scale = 2.0
        track._learn(by_scan, np.eye(3))
        widths.append(math.log(track._scale / 2.0))
    assert widths == pytest.approx([0.1 * 9.0, -0.1 / 10.0])
    track._scale = 1.0
    track._learn(np.zeros(3), np.eye(3))
    assert track._scale == 1.0


def test_the_pose_of_a_missed_scan_is_the_prediction():
    track = driven()
    found = track.predict(stamped(30))
    track.missed(stamped(30))
    assert track.pose == found.pose
    assert track.covariance is track.predicted
    assert track._sight == CLEAR


@pytest.mark.parametrize(("deviation", "held"), [(0.01, True), (0.6, False)])
def test_wheels_hold_a_pose_only_while_they_are_sure(deviation, held):
    track = driven()
    track.predict(stamped(30))
    track._seconds, track.predicted = 1.5, deviation**2 * np.eye(3)
    track.missed(stamped(30))
    assert track.held == held
    assert track.state == ("predicted" if held else "lost")


def test_how_far_a_robot_can_have_come_grows_with_the_time_since_the_last_match():
    track = driven()
    track.predict(stamped(30))
    for k, ways in ((30, (0.3, 0.9)), (40, (3.0, 9.0))):
        track._seconds = 0.1 * (k - 29)
        can, cannot = (track.pose @ Pose2(way * P.top_speed / 3.0, 0.0, 0.0) for way in ways)
        assert track.reachable(can), k
        assert not track.reachable(cannot @ Pose2(P.leap + P.top_speed, 0.0, 0.0)), k


def test_a_charge_is_the_logarithm_of_students_law_shared_by_independent_beams():
    track = driven()
    track.predict(stamped(30))
    off = 2.0 / math.sqrt(track._information[0, 0])
    pose = track._prediction.pose
    moved = Pose2(pose.x + off, pose.y, pose.theta)
    d2 = off * off * track._information[0, 0]
    expected = 0.5 * FREEDOM * math.log1p(d2 / FREEDOM) / INDEPENDENT
    assert track.charge(moved) == pytest.approx(expected)


def test_a_start_that_is_elsewhere_is_held_less():
    track = driven()
    track.predict(stamped(30))
    pose = track._prediction.pose
    assert track.prior(pose) == pytest.approx(track._information)
    held = track.prior(Pose2(pose.x + 1.0, pose.y, pose.theta))
    assert held[0, 0] < 1.01 and held[1, 1] == pytest.approx(track._information[1, 1], rel=1e-3)


def test_the_first_scan_is_where_the_map_begins_and_as_sure():
    track = Track(P)
    track.predict(stamped(0))
    track.matched(IDENTITY, np.zeros((3, 3)), stamped(0))
    assert np.diag(track.covariance).max() < 1e-9


def test_a_laser_that_begins_without_wheels_may_be_carried_sideways():
    for wheels in (True, False):
        track = Track(P)
        track.predict(stamped(0, wheels))
        aside = P.acceleration_aside if wheels else P.acceleration
        assert track.motion._params.acceleration_aside == aside
    assert _without_wheels(P).acceleration == P.acceleration


def test_the_same_error_adds_deviations_until_the_pose_is_anywhere():
    a, b = 4.0 * np.eye(3), 1.0 * np.eye(3)
    assert _with_the_same_error(a, b) + b == pytest.approx((2.0 + 1.0) ** 2 * np.eye(3))
    anywhere = FAR**2 * np.eye(3)
    assert _with_the_same_error(anywhere, b) is anywhere


def after_a_gap(wheels, missed):
    """A track whose first match comes two seconds after the last."""
    track = driven(wheels=wheels)
    for k in range(30, 50):
        if missed or k == 49:
            track.predict(stamped(k, wheels))
        if missed and k < 49:
            track.missed(stamped(k, wheels))
    track.predicted = 9.0 * np.eye(3)
    track.matched(track._prediction.pose, ROOM, stamped(49, wheels))
    return track


@pytest.mark.parametrize("missed", [True, False])
def test_the_first_match_after_a_gap_has_to_stand_for_a_second_unless_wheels_led_there(missed):
    assert after_a_gap(wheels=True, missed=missed).state == "matched"
    track = after_a_gap(wheels=False, missed=missed)
    assert track.state == "lost" and track.unproven and not track.adrift
    k = 50
    while track.state == "lost":
        track.predict(stamped(k, wheels=False))
        track.matched(track._prediction.pose, ROOM, stamped(k, wheels=False))
        k += 1
    assert 0.1 * (k - 50) == pytest.approx(LOST_AFTER, abs=0.11)


# the motion


def test_a_velocity_by_wheels_is_of_the_middle_of_the_interval():
    velocity, over = Velocity(1.0, 2.0, 1.0), interval(0.5, 1.0)
    velocity.pass_over(over)
    before, spread = velocity.v, velocity.vv
    velocity.correct_velocity(1.0, 0.1, 0.5)
    lag = 0.25 * 0.5**2 * 1.0
    assert velocity.v - before == pytest.approx(spread / (spread + 0.1 + lag))
    assert velocity.vv == pytest.approx(spread * (1.0 - spread / (spread + 0.1 + lag)))


def test_what_lasts_goes_on_and_a_pose_reported_is_no_error():
    velocity, over = Velocity(1.0, 2.0, 1.0), interval(0.5, 1.0)
    velocity.v, velocity.a = 0.4, 0.2
    step, _ = velocity.step(over)
    assert step == pytest.approx(0.5 * 0.4 + over.xa * 0.2)
    velocity.pass_over(over)
    assert velocity.x == pytest.approx(step)
    velocity.report(step)
    assert velocity.x == pytest.approx(0.0)


def test_an_arc_whose_speed_and_turn_change_ends_aside():
    motion = Motion(P)
    for axis in motion._axes:
        axis.v, axis.vv, axis.va, axis.aa = 0.0, 0.0, 0.0, 0.0
    ahead, _, turn = motion._axes
    ahead.v, turn.v, turn.vv = 2.0, 1.0, 0.5
    expected = motion._going_on(0.1)
    plain = [axis.step(motion._over)[1] for axis in motion._axes]
    bent = (2.0 * 0.1) ** 2 * plain[2] + (1.0 * 0.1) ** 2 * plain[0] + plain[0] * plain[2]
    assert expected.variance.aside - plain[1] == pytest.approx(bent / 80.0, rel=1e-6)


def test_a_heading_that_is_unsure_swings_the_step():
    motion, told = Motion(P), []
    motion._wheels.compare = lambda step, both, dt: told.append(both)
    for k in range(3):
        motion.predict(Pose2(k, 0.0, 0.0), stamped(k))
        covariance = np.diag([1e-4, 1e-4, 1e-2])
        motion.moved(Pose2(k + 1.0, 0.0, 0.0), covariance, stamped(k))
    assert told[-1].aside == pytest.approx(2e-4 + 1e-2 * 1.0)
    assert told[-1].ahead == pytest.approx(2e-4) and told[-1].turn == pytest.approx(2e-2)


def test_without_a_match_doubt_and_velocity_fade():
    motion = Motion(P)
    for k in range(2):
        motion.predict(IDENTITY, stamped(k))
        motion.moved(IDENTITY, None, stamped(k))
    motion.predict(IDENTITY, stamped(2))
    doubt, velocity = motion._wheels._doubts[0], motion._axes[0]
    doubt.variance, velocity.v = 1.0, 0.5
    motion.missed(stamped(2))
    assert doubt.variance == pytest.approx(math.exp(-0.2 / P.doubt_time))
    assert 0.0 < velocity.v < 0.5


# the sources


def test_wheels_contradict_a_velocity_over_a_short_interval_only():
    for dt, contradicts in ((0.9 * P.witness_time, True), (1.1 * P.witness_time, False)):
        wheels = Wheels(P)
        before, scan = Scan(0.0, *BEAM, IDENTITY), Scan(dt, *BEAM, Pose2(0.3 * dt, 0.0, 0.0))
        known = Expected(NOTHING, CERTAIN, dt, dt)
        wheels.add(before, scan, known)
        assert wheels.contradicts == contradicts


def test_a_turn_that_a_gyro_measured_is_not_made_doubtful_by_wheels():
    for measured in (True, False):
        before, scan = Scan(0.0, *BEAM, IDENTITY), Scan(0.1, *BEAM, Pose2(0.0, 0.0, 0.2))
        spread = CERTAIN._replace(turn=1e-6)
        found = Wheels(P).add(before, scan, Expected(NOTHING, spread, 0.1, 0.1, measured))
        assert (abs(found.step.turn) < 1e-3) == measured
        assert (found.variance.turn < 1e-5) == measured


def test_a_gyro_that_passes_half_a_turn_goes_on():
    before, scan = Scan(0.0, *BEAM, None, 3.1), Scan(0.1, *BEAM, None, -3.1)
    assert gyro_turn(before, scan) == pytest.approx(2.0 * math.pi - 6.2)
    known = Expected(NOTHING, CERTAIN._replace(turn=1.0), 0.1, 0.1)
    assert Gyro(P).add(before, scan, known).step.turn == pytest.approx(0.083, abs=0.001)


def test_wheels_that_are_not_finite_say_nothing():
    good, bad = Scan(0.0, *BEAM, IDENTITY), Scan(0.1, *BEAM, Pose2(math.nan, 0.0, 0.0))
    assert wheel_step(good, bad) is None and wheel_step(bad, good) is None


def test_no_robot_turns_round_at_once_however_it_moves():
    limits, known = Limits(P), Expected(NOTHING, CERTAIN, 0.05, 0.05)
    most = P.top_turn_acceleration * 0.05**2 + P.leap
    for turn, possible in ((0.99 * most, True), (1.1 * most, False)):
        assert limits.allow_step(NOTHING._replace(turn=turn), known) == possible
    assert most < P.top_turn_rate * 0.05 + P.leap


def test_doubt_is_the_velocity_that_was_not_seen_and_fades_in_its_time():
    doubt = Doubt(P, 3.0)
    doubt.learn(0.1, 1e-6, 0.1)
    learned = 1.0 - math.exp(-0.1 / P.doubt_time)
    assert doubt.variance == pytest.approx(learned * 1.0)  # (1 m/s)^2
    doubt.fade(0.5 * P.doubt_time)
    assert doubt.variance == pytest.approx(learned * math.exp(-1.0))


def test_a_scale_of_three_may_be_chance_and_more_counts():
    scale = Scale(P)
    for learned, times in ((3.0, 1.0), (10.0, 3.0)):
        scale._learned = learned
        assert scale.variance == pytest.approx(times)


def test_what_noise_turns_a_wall_by_is_taken_off():
    lidar, seen = laser(721), []
    ranges = cast(CORRIDOR, (0.0, 0.2, 0.0), lidar).astype(np.float32)
    for noise in (0.0, 0.005, 0.01):
        out = np.zeros(N_FACES)
        faces(ranges, lidar.directions, 1, 5.0, noise, out)
        seen.append(out[:3])
    assert seen[0][0] == pytest.approx(0.0, abs=1e-3) and seen[0][2] > 100.0
    assert seen[2][0] == pytest.approx(4.0 * seen[1][0], rel=1e-2)
    assert seen[2][0] < -0.1


def test_a_scan_alone_has_the_pose_farther_off_than_what_lies_between_it_and_the_prediction():
    track = driven(wheels=False)
    track.predict(stamped(30, wheels=False))
    known = track._information
    pose = track._prediction.pose @ Pose2(0.02, -0.01, 0.0)
    off = track._off(pose)
    assert track._by_scan(pose, known) == pytest.approx(2.0 * off, rel=1e-2, abs=1e-6)
    assert track._by_scan(pose, 1e6 * known) == pytest.approx(off, rel=1e-3, abs=1e-6)
