"""How wheels, gyro and the motion so far are weighed, one number at a time."""

import math

import numpy as np
import pytest

from slams.motion.chord import CERTAIN, NOTHING
from slams.motion.clock import MEMORY, Clock
from slams.motion.model import Motion
from slams.motion.params import MotionParams
from slams.motion.trust import Doubt, Expected, Limits, Scale
from slams.motion.velocity import Velocity, interval
from slams.motion.wheels import Gyro, Wheels, gyro_turn, wheel_step
from slams.types import IDENTITY, Pose2, Scan
from tests.rooms import laser

P = MotionParams()
BEAM = (np.full(10, 2.0, np.float32), laser(10))
STEP = 0.05  # m in 0.1 s


def stamped(k):
    return Scan(0.1 * k, *BEAM, Pose2(STEP * k, 0.0, 0.0))


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
    motion, told, corrected = Motion(P), [], []
    motion._wheels.compare = lambda step, both, dt: told.append(both)
    motion._correct = lambda step, match: corrected.append(match)
    for k in range(3):
        motion.predict(Pose2(k, 0.0, 0.0), stamped(k))
        covariance = np.diag([1e-4, 1e-4, 1e-2])
        motion.moved(Pose2(k + 1.0, 0.0, 0.0), covariance, stamped(k))
    assert told[-1].aside == pytest.approx(2e-4 + 1e-2 * 1.0)
    assert told[-1].ahead == pytest.approx(2e-4) and told[-1].turn == pytest.approx(2e-2)
    assert corrected[-1] == pytest.approx((1e-4, 1e-4 + 1e-2, 1e-2))


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


def test_what_stamps_and_their_number_foretell_is_remembered_apart():
    clock = Clock()
    for stamped in (0.1, 0.1, 0.2):
        clock.elapsed(stamped)
        clock.found(NOTHING._replace(ahead=stamped))
    share = 1.0 - math.exp(-clock.usual / MEMORY)
    assert clock._error_by_stamps == pytest.approx(0.0, abs=1e-12)
    assert clock._error_by_count == pytest.approx(share * 0.1)
    before = clock._error_by_count
    clock.elapsed(0.2)
    clock.found(NOTHING._replace(ahead=0.2))  # as long again
    assert clock._error_by_count == pytest.approx(before * math.exp(-clock.usual / MEMORY))
    clock._error_by_stamps = 2.0 * clock._error_by_count
    clock.usual, clock._scans = 0.1, 1000
    assert clock.ragged and clock.elapsed(0.5) == clock.usual
    assert clock.elapsed(2.0) == 2.0  # a break, however ragged the stamps


def test_a_contradicted_step_may_be_wrong_with_the_velocity_that_it_was_told_by():
    velocity = Velocity(1.0, 1.0, 1.0)
    velocity.xx, velocity.xv, velocity.vv = 0.5, 0.25, 2.0
    velocity.contradict(0.08, 0.4)  # an error e of the step is one of e / dt of the velocity
    assert (velocity.xx, velocity.xv, velocity.vv) == pytest.approx((0.58, 0.45, 2.5))
