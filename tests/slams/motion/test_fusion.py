"""How wheels, gyro and the motion so far are weighed, one number at a time."""

import math

import numpy as np
import pytest

from slams.jit import records
from slams.motion import source_kernels, velocity_kernels
from slams.motion.chord import CERTAIN, NOTHING, UNKNOWN, Chord
from slams.motion.clock import MEMORY, Clock
from slams.motion.model import Motion
from slams.motion.params import MotionParams
from slams.motion.trust import Expected, laws
from slams.motion.velocity import Velocity
from slams.motion.wheels import Gyro, Wheels, fade, gyro_turn
from slams.types import IDENTITY, Pose2, Scan
from tests.rooms import laser

P = MotionParams()
BEAM = (np.full(10, 2.0, np.float32), laser(10))
STEP = 0.05  # m in 0.1 s


def stamped(k):
    return Scan(0.1 * k, *BEAM, Pose2(STEP * k, 0.0, 0.0))


# the motion


def going(dt, last=1.0):
    """One axis with accelerations of 1 m/s^2, and half a second that passes it."""
    axes, over = records(1, velocity_kernels.AXIS), records(1, velocity_kernels.INTERVAL)
    axes["noise"], axes["aa"], axes["vv"] = 1.0, 1.0, 4.0
    velocity_kernels.interval(over, dt, last)
    return axes, over


def test_a_velocity_by_wheels_is_of_the_middle_of_the_interval():
    axes, over = going(0.5)
    velocity_kernels.pass_over(axes[0], over[0])
    before, spread = axes["v"][0], axes["vv"][0]
    velocity_kernels.correct_velocity(axes[0], 1.0, 0.1, 0.5)
    lag = 0.25 * 0.5**2 * 1.0
    assert axes["v"][0] - before == pytest.approx(spread / (spread + 0.1 + lag))
    assert axes["vv"][0] == pytest.approx(spread * (1.0 - spread / (spread + 0.1 + lag)))


def test_what_lasts_goes_on_and_a_pose_reported_is_no_error():
    velocity, expected = Velocity(P), Expected()
    velocity.axes["v"], velocity.axes["a"] = 0.4, 0.2
    velocity.going_on(0.5, expected)
    step, _, _ = expected.told()
    b = 0.5 / P.acceleration_time
    lasts = P.acceleration_time**2 * (b - 1.0 + math.exp(-b))
    assert step == pytest.approx([0.5 * 0.4 + lasts * 0.2] * 3)
    velocity.believe(step, Wheels(P), Gyro(P))
    assert velocity.axes["x"] == pytest.approx([0.0] * 3)
    assert velocity.axes["v"] == pytest.approx(
        [0.4 + P.acceleration_time * (1 - math.exp(-b)) * 0.2] * 3
    )


def test_an_arc_whose_speed_and_turn_change_ends_aside():
    velocity = Velocity(P)
    for name in ("v", "vv", "va", "aa"):
        velocity.axes[name] = 0.0
    plain = expected_variance(velocity)
    velocity.axes["v"], velocity.axes["vv"][2] = (2.0, 0.0, 1.0), 0.5
    ahead, aside, turn = expected_variance(velocity)
    bent = (2.0 * 0.1) ** 2 * turn + (1.0 * 0.1) ** 2 * ahead + ahead * turn
    assert aside - plain[1] == pytest.approx(bent / 80.0, rel=1e-6)


def expected_variance(velocity):
    expected = Expected()
    velocity.going_on(0.1, expected)
    return expected.told()[1]


def test_a_heading_that_is_unsure_swings_the_step():
    """By as much as a match that is as unsure aside as the swung step is."""
    swung, unsure, plain = (Velocity(P) for _ in range(3))
    last, match, step = Chord(1e-4, 1e-4, 1e-2), Chord(1e-4, 1e-4, 1e-2), Chord(1.0, 0.1, 0.0)
    sure = Chord(1e-4, 1e-4, 0.0)
    cases = ((swung, match, last), (unsure, match._replace(aside=1e-4 + 1e-2), sure))
    for velocity, at_end, at_start in (*cases, (plain, match, sure)):
        velocity.axes["vv"] = 1e-2
        velocity.going_on(1.0, Expected())
        velocity.learn(step, at_end, at_start, Wheels(P), Gyro(P))
    assert swung.axes["v"] == pytest.approx(unsure.axes["v"])
    assert abs(swung.axes["v"][1]) < 0.9 * abs(plain.axes["v"][1])


def test_the_errors_of_both_ends_excuse_the_wheels():
    for deviation, doubted in ((1e-4, True), (0.1, False)):
        velocity, wheels, gyro, expected = Velocity(P), Wheels(P), Gyro(P), Expected()
        expected.dt = expected.reach = 0.1
        velocity.going_on(0.1, expected)
        wheels.add(stamped(0), stamped(1), expected)
        last, match = Chord(deviation**2, 1e-8, 1e-8), Chord(1e-8, 1e-8, 1e-8)
        velocity.learn(Chord(0.0, 0.0, 0.0), match, last, wheels, gyro)
        assert wheels.faults == doubted and (wheels.numbers["doubt"][0] > 0.0) == doubted


def test_without_a_match_doubt_and_velocity_fade():
    motion = Motion(P)
    for k in range(2):
        motion.predict(IDENTITY, stamped(k))
        motion.moved(IDENTITY, None, stamped(k))
    motion.predict(IDENTITY, stamped(2))
    doubt, velocity = motion._wheels.numbers["doubt"], motion._motion.axes["v"]
    doubt[0], velocity[0] = 1.0, 0.5
    motion.missed(stamped(2))
    assert doubt[0] == pytest.approx(math.exp(-0.2 / P.doubt_time))
    assert 0.0 < velocity[0] < 0.5


# the sources


def expecting(dt, variance=CERTAIN, measured=False):
    """No motion, with such variances, in `dt` [s]; its turn measured by a gyro or not."""
    expected = Expected()
    expected.set(NOTHING, variance)
    expected.dt = expected.reach = dt
    expected.rows["measured"][2] = measured
    return expected


def test_wheels_contradict_a_velocity_over_a_short_interval_only():
    for dt, contradicts in ((0.9 * P.witness_time, True), (1.1 * P.witness_time, False)):
        wheels = Wheels(P)
        before, scan = Scan(0.0, *BEAM, IDENTITY), Scan(dt, *BEAM, Pose2(0.3 * dt, 0.0, 0.0))
        wheels.add(before, scan, expecting(dt))
        assert wheels.contradicts == contradicts


def test_a_turn_that_a_gyro_measured_is_not_made_doubtful_by_wheels():
    for measured in (True, False):
        before, scan = Scan(0.0, *BEAM, IDENTITY), Scan(0.1, *BEAM, Pose2(0.0, 0.0, 0.2))
        spread = CERTAIN._replace(turn=1e-6)
        found = expecting(0.1, spread, measured)
        Wheels(P).add(before, scan, found)
        step, variance, known = found.told()
        assert (abs(step.turn) < 1e-3) == measured and known == NOTHING
        assert (variance.turn < 1e-5) == measured


def test_a_gyro_that_passes_half_a_turn_goes_on():
    before, scan = Scan(0.0, *BEAM, None, 3.1), Scan(0.1, *BEAM, None, -3.1)
    assert gyro_turn(before, scan) == pytest.approx(2.0 * math.pi - 6.2)
    found = expecting(0.1, CERTAIN._replace(turn=1.0))
    Gyro(P).add(before, scan, found)
    assert found.told()[0].turn == pytest.approx(0.083, abs=0.001)


def test_where_no_match_tells_the_turn_the_surer_of_gyro_and_wheels_does():
    """A gyro by its own variance, not by what is known with it."""
    for gyro_noise, told in ((P.gyro_noise, 0.3), (10.0, 0.5)):
        params = P.replace(gyro_noise=gyro_noise, witness_time=0.0)
        velocity, wheels, gyro = Velocity(params), Wheels(params), Gyro(params)
        before = Scan(0.0, *BEAM, IDENTITY, 0.0)
        scan = Scan(0.1, *BEAM, Pose2(0.0, 0.0, 0.05), 0.03)
        expected = expecting(0.1, Chord(1.0, 1.0, 1.0))
        velocity.going_on(0.1, Expected())
        gyro.add(before, scan, expected)
        wheels.add(before, scan, expected)
        velocity.believe(expected.told()[0], wheels, gyro)
        assert velocity.axes["v"][2] == pytest.approx(told, abs=0.02)


def test_wheels_that_are_not_finite_say_nothing():
    good, bad = Scan(0.0, *BEAM, IDENTITY), Scan(0.1, *BEAM, Pose2(math.nan, 0.0, 0.0))
    west, east = (Scan(0.0, *BEAM, Pose2(x, x, 0.0)) for x in (-1.7e308, 1.7e308))  # no step
    for pair in ((good, bad), (bad, good), (west, east)):
        wheels, found = Wheels(P), expecting(0.1)
        wheels.add(good, Scan(0.1, *BEAM, Pose2(0.01, 0.0, 0.0)), expecting(0.1))
        wheels.add(*pair, found)
        assert not wheels.heard and not wheels.contradicts and wheels.faults == 0
        assert found.told() == (NOTHING, CERTAIN, NOTHING)
        assert wheels.numbers["variance"].tolist() == list(UNKNOWN)


def test_no_robot_turns_round_at_once_however_it_moves():
    known = expecting(0.05).rows
    most = P.top_turn_acceleration * 0.05**2 + P.leap
    for turn, possible in ((0.99 * most, True), (1.1 * most, False)):
        step = (0.0, 0.0, turn)
        assert source_kernels.allow_step(laws(P), step, known, (0.0, 0.0, 0.0), 0.05) == possible
    assert most < P.top_turn_rate * 0.05 + P.leap


def test_doubt_is_the_velocity_that_was_not_seen_and_fades_in_its_time():
    sources, law = records(1, source_kernels.SOURCE), laws(P)
    sources["most"] = 9.0
    assert source_kernels.learn_doubt(sources[0], law[0], 0.1, 1e-6, 0.1)
    learned = 1.0 - math.exp(-0.1 / P.doubt_time)
    assert sources["doubt"][0] == pytest.approx(learned * 1.0)  # (1 m/s)^2
    fade(sources, P.doubt_time, 0.5 * P.doubt_time)
    assert sources["doubt"][0] == pytest.approx(learned * math.exp(-1.0))


def test_a_scale_of_three_may_be_chance_and_more_counts():
    for learned, times in ((3.0, 1.0), (10.0, 3.0)):
        own = {}
        for scale in (1.0, learned):
            wheels = Wheels(P)
            wheels.numbers["scale"] = scale
            wheels.add(stamped(0), stamped(1), expecting(0.1, Chord(1.0, 1.0, 1.0)))
            own[scale] = wheels.numbers["own"]
        assert own[learned] == pytest.approx(times * own[1.0])


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
    axes, _ = going(0.4)
    axes["xx"], axes["xv"], axes["vv"] = 0.5, 0.25, 2.0
    velocity_kernels.contradict(axes[0], 0.08, 0.4)  # an error e of x, e / dt of v
    assert axes[["xx", "xv", "vv"]][0].tolist() == pytest.approx((0.58, 0.45, 2.5))
