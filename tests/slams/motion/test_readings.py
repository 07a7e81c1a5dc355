"""Wheels told seldom or out of step with the laser: what a step lacks the next has too much."""

import math

import numpy as np
import pytest

from slams.jit import records
from slams.motion import reading_kernels as kernels
from slams.motion.model import Motion
from slams.motion.params import MotionParams
from slams.motion.source_kernels import LEAP, SOURCE, allow_step, hear_wheels
from slams.motion.trust import Expected, laws
from slams.types import Pose2, Scan
from tests.rooms import laser

P = MotionParams()
BEAM = (np.full(10, 2.0, np.float32), laser(10))
SPEED, TURN = 0.5, 0.1  # m/s, rad/s


def at(t):
    """A robot that starts slowly and goes round at an even speed from the first second on."""
    way = SPEED * (0.5 * min(t, 1.0) ** 2 + max(t - 1.0, 0.0))
    angle = TURN / SPEED * way
    radius = SPEED / TURN
    return Pose2(radius * math.sin(angle), radius * (1.0 - math.cos(angle)), angle)


def told(t, wheel_rate):
    """The last pose of wheels that tell theirs so many times a second."""
    return at(math.floor(t * wheel_rate) / wheel_rate)


def blind(rate, wheel_rate, seeing=4.0, seconds=30.0):
    """How far [m] the robot is taken to be from where it is after a while without any match."""
    motion, pose, off = Motion(P), at(0.0), []
    for t in np.arange(0.0, seconds, 1.0 / rate).tolist():
        scan = Scan(t, *BEAM, told(t, wheel_rate))
        predicted = motion.predict(pose, scan)
        if t < seeing:
            pose = at(t)
            motion.moved(pose, 1e-6 * np.eye(3), scan)
        else:
            pose = predicted.pose
            motion.moved(pose, np.diag([100.0, 100.0, 1.0]), scan)
            true = at(t)
            off.append(math.hypot(pose.x - true.x, pose.y - true.y))
    return np.array(off)


@pytest.mark.parametrize(
    ("rate", "wheel_rate"), [(40, 9.7), (40, 4.3), (10, 4.3), (5, 9.7), (5, 4.3)]
)
def test_where_nothing_is_matched_late_readings_do_not_add_up(rate, wheel_rate):
    off = blind(rate, wheel_rate)
    half = len(off) // 2
    assert off.max() < SPEED / wheel_rate + 0.05  # one reading
    assert off[half:].mean() < off[:half].mean() + 0.05


@pytest.mark.parametrize("rate", [40, 5])
def test_wheels_in_step_with_the_laser_are_not_taken_to_be_late(rate):
    motion, pose = Motion(P), at(0.0)
    for t in np.arange(0.0, 10.0, 1.0 / rate).tolist():
        scan = Scan(t, *BEAM, at(t))
        motion.predict(pose, scan)
        pose = at(t)
        motion.moved(pose, 1e-6 * np.eye(3), scan)
    wheels = motion._wheels
    assert wheels._reads["ragged"][0] == 0.0
    assert wheels.numbers["late"].tolist() == [0.0] * 3
    assert wheels.numbers["at"] == pytest.approx(tuple(pose), abs=1e-12)


def reading(steps, dt=0.1, slips=0.0, expected=0.0):
    """What is learned of steps ahead [m]; the steps after the first four are at full speed."""
    wheels, reads = records(3, SOURCE), records(1, kernels.READING)
    kernels.begin(wheels, reads, (0.0, 0.0, 0.0))
    for step in steps:
        kernels.learn_lateness(wheels, reads[0], (step, 0.0, 0.0), expected, slips, dt)
    return wheels, reads


def variance(steps, **kind):
    wheels, reads = reading(steps, expected=0.05, **kind)
    expected = Expected()
    expected.set((0.05, 0.0, 0.0), (1e-4, 1e-4, 1e-4))
    return kernels.lateness(wheels, reads[0], expected.rows, 0.1)


def test_half_a_step_that_is_late_every_so_often_tells_how_late():
    steady = [0.05] * 40
    assert variance(steady) == (0.0, 0.0, 0.0)
    late = ([0.05] * 4 + [0.025, 0.075]) * 7
    ahead, aside, turn = variance(late)
    assert 0.005**2 < ahead < 0.025**2  # the reading is 0 to 25 mm behind
    assert aside == turn == 0.0
    assert variance(late, slips=0.025**2)[0] < 0.25 * ahead  # slips explain most of that


def test_speeding_up_and_slowing_down_is_no_lateness():
    ramp = np.concatenate([np.linspace(0.0, 0.05, 10), np.linspace(0.05, 0.0, 10)])
    assert variance(np.tile(ramp, 3).tolist())[0] < 0.003**2


def test_key_scans_are_no_late_readings():
    """Some way or some turn apart, so their steps go to and fro."""
    for apart, ragged in ((0.9, True), (1.1, False)):
        dt = apart * kernels.APART
        _, reads = reading([0.5, 0.3] * 20, dt=dt, expected=0.4)
        assert (reads["ragged"][0] > 0.0) == ragged


def test_a_leap_of_the_odometry_is_not_late():
    _, reads = reading([0.05] * 20 + [1.0] + [0.05] * 3, expected=0.05)
    assert reads["ragged"][0] == 0.0


def test_readings_are_never_later_than_a_fifth_of_a_second():
    wheels, reads = reading([0.0, 0.24] * 40, expected=0.05)
    expected = Expected()
    ahead, _, _ = kernels.lateness(wheels, reads[0], expected.rows, 0.1)
    assert ahead == pytest.approx((kernels.LATEST * wheels["rate"][0]) ** 2)


def slipping_and_late(late, slips, heading=0.5, turned=0.5):
    """Wheels whose robot is at (1, 2), with such a heading, and which tell (1, 2, turned)."""
    wheels = records(3, SOURCE)
    wheels["at"], wheels["now"] = (1.0, 2.0, heading), (1.0, 2.0, turned)
    wheels["late"], wheels["own"] = late, late + slips
    return wheels


def test_a_step_is_shared_between_lateness_and_slip():
    c, s = math.cos(0.1), math.sin(0.1)  # half way
    found, now = (
        Pose2(1.0, 2.0, 0.5) @ Pose2(0.1 * c - 0.02 * s, 0.1 * s + 0.02 * c, 0.2),
        Pose2(1.0, 2.0, 0.5),
    )
    for late, slips, share in ((0.0, 1.0, 0.0), (0.1, 1.5, 0.25), (1.0, 0.0, 1.0)):
        wheels = slipping_and_late(late, slips)
        kernels.settle(wheels, (0.1, 0.02, 0.2), 0.1)  # 5 readings are late alike
        for number, to, told_at in zip(wheels["at"], found, now, strict=True):
            assert number == pytest.approx(told_at + share * (to - told_at))


def test_a_step_is_taken_back_into_what_the_wheels_count():
    wheels = slipping_and_late(1.0, 0.0, heading=0.0, turned=0.0)
    wheels["wrong"][0] = 0.25  # 0.1 m is 0.08 m for the wheels
    kernels.settle(wheels, (0.1, 0.05, 0.0), 0.1)
    assert wheels["at"] == pytest.approx([1.08, 2.04, 0.0])
    reads, known = records(1, kernels.READING), Expected()
    known.set((0.1, 0.05, 0.0), (1.0, 1.0, 1.0))
    reads["known"] = 1.0
    by = (wheels, reads, laws(P), known.rows)
    hear_wheels(*by, (1.0, 2.0, 0.0), (1.16, 2.08, 0.1), 0.1, 0.1)
    ahead, aside = 0.1 * math.cos(0.05), 0.1 * math.sin(0.05)
    assert wheels["said"] == pytest.approx([ahead + 0.5 * aside, 0.5 * ahead - aside, 0.1])


def test_a_turn_over_the_back_is_short():
    wheels = slipping_and_late(1.0, 5.0, heading=3.1, turned=-3.1)
    kernels.settle(wheels, (0.0, 0.0, 0.0), 0.1)
    assert wheels["at"][2] == pytest.approx(-3.1 - 0.5 * (2.0 * math.pi - 6.2))


def test_what_late_readings_make_of_a_step_is_no_leap():
    known = Expected()
    known.set((0.01, 0.0, 0.0), (1e-8, 1e-8, 1e-8))
    step = (0.12, 0.0, 0.0)
    for late, possible in ((0.0, False), (0.03**2, True)):
        assert allow_step(laws(P), step, known.rows, (late, 0.0, 0.0), 0.025) == possible
    turn = (0.01, 0.0, 0.12)
    for late, possible in ((0.0, False), (0.03**2, True)):
        assert allow_step(laws(P), turn, known.rows, (0.0, 0.0, late), 0.025) == possible


def test_a_step_may_be_late_whichever_way_it_goes_and_before_its_mean_is_known():
    _, reads = reading(([0.05] * 4 + [0.025, 0.075]) * 7, expected=0.05)
    wheels, expected = records(3, SOURCE), Expected()
    expected.set((0.02, -0.04, 0.06), (1e-4, 1e-4, 1e-4))
    late = np.array(kernels.lateness(wheels, reads[0], expected.rows, 0.1))
    assert late[0] > 0.0
    assert late == pytest.approx(late[0] * np.array((1.0, 4.0, 9.0)))
    wheels["rate"] = (0.4, 0.1, 0.9)
    mean = np.array(kernels.lateness(wheels, reads[0], expected.rows, 0.1))
    assert mean == pytest.approx(late[0] * np.array((4.0, 4.0, 2.25 * 9.0)))


def test_what_contradicts_all_else_is_not_late():
    for step, late in ((0.06, True), (0.25, False)):
        wheels, reads = reading(([0.05] * 4 + [0.025, 0.075]) * 7, expected=0.05)
        known = Expected()
        known.set((0.05, 0.0, 0.0), (1e-8, 1e-8, 1e-8))
        by = (wheels, reads, laws(P), known.rows)
        hear_wheels(*by, (0.0, 0.0, 0.0), (step, 0.0, 0.0), 0.1, 0.2)
        assert (wheels["late"][0] > 0.0) == late


def test_odometry_after_a_pause_of_it_is_reckoned_from_its_new_poses():
    wheels, reads, known = records(3, SOURCE), records(1, kernels.READING), Expected()
    known.set((0.05, 0.0, 0.0), (1.0, 1.0, 1.0))
    by = (wheels, reads, laws(P), known.rows)
    hear_wheels(*by, (0.0, 0.0, 0.0), (0.05, 0.0, 0.0), 0.1, 0.1)
    bad = (math.nan, 0.0, 0.0)
    hear_wheels(*by, (0.05, 0.0, 0.0), bad, 0.1, 0.1)
    assert hear_wheels(*by, (7.0, 0.0, 0.0), (7.05, 0.0, 0.0), 0.1, 0.1) != LEAP
    assert wheels["said"][0] == pytest.approx(0.05)
