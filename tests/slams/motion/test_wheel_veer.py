"""Wheels that count a turn of every way: learned where scans see for themselves."""

import math

import numpy as np
import pytest

from slams.jit import records
from slams.motion import reading_kernels, source_kernels
from slams.motion import scale_kernels as kernels
from slams.motion.model import Motion
from slams.motion.params import MotionParams
from slams.motion.trust import laws
from slams.types import Pose2, Scan
from tests.rooms import laser

P = MotionParams()
LAW = laws(P)[0]
BEAM = (np.full(10, 2.0, np.float32), laser(10))
SURE, BLIND = 1e-6 * np.eye(3), 100.0 * np.eye(3)


def driven(veer, seeing, seconds, rate=10, speed=0.5, counted=1.0):
    """A straight drive whose wheels tell a turn of so much a meter; blind after `seeing` [s].

    Also how far the robot was off in the end [rad] and [m].
    """
    motion, pose = Motion(P), Pose2(0.0, 0.0, 0.0)
    for t in np.arange(0.0, seconds, 1.0 / rate).tolist():
        turn = veer * counted * speed * t
        told = Pose2(math.sin(turn) / veer, (1.0 - math.cos(turn)) / veer, turn)
        scan = Scan(t, *BEAM, told)
        predicted = motion.predict(pose, scan).pose
        sees = t < seeing
        pose = Pose2(speed * t, 0.0, 0.0) if sees else predicted
        motion.moved(pose, SURE if sees else BLIND, scan)
    return motion, pose.theta, math.hypot(pose.x - speed * t, pose.y)


def veer_of(motion):
    return motion._wheels.numbers["wrong"][2]


@pytest.mark.parametrize("veer", [-0.1, 0.02, 0.05])
@pytest.mark.parametrize("speed", [0.5, -0.5])
def test_what_was_learned_of_the_veer_holds_where_nothing_is_seen(veer, speed):
    motion, turned, off = driven(veer, seeing=40.0, seconds=80.0, speed=speed)
    assert veer_of(motion) == pytest.approx(-veer, abs=0.002)
    step, wheels = 0.1 * speed, motion._wheels.numbers
    unsure = P.turn_slip_way**2 * abs(step) + (0.5 * P.veer * step) ** 2
    assert wheels["own"][2] < unsure
    assert abs(turned) < 0.03  # in 20 m; unlearned .4 to 2 rad
    assert off < 0.3  # unlearned 4 m and more


def test_veer_is_of_the_way_as_the_wheels_count_it():
    motion, _, _ = driven(0.1, seeing=40.0, seconds=40.0, counted=1.2)
    assert veer_of(motion) == pytest.approx(-0.1, abs=0.003)


def test_a_heading_that_follows_the_wheels_does_not_confirm_them():
    motion, _, _ = driven(0.05, seeing=0.3, seconds=60.0)
    assert veer_of(motion) == 0.0
    assert motion._wheels.numbers["unsure"][2] == pytest.approx(kernels.VEER**2, rel=1e-2)


def test_a_corridor_shows_the_veer():
    motion, pose = Motion(P), Pose2(0.0, 0.0, 0.0)
    for t in np.arange(0.0, 90.0, 0.1).tolist():
        turn = 0.025 * t
        scan = Scan(t, *BEAM, Pose2(math.sin(turn) / 0.05, (1.0 - math.cos(turn)) / 0.05, turn))
        pose = Pose2(motion.predict(pose, scan).pose.x, 0.0, 0.0)
        motion.moved(pose, np.diag([100.0, 1e-6, 1e-6]), scan)
    assert motion._wheels.numbers["blind"][0] > 4.0 * kernels.BLIND
    assert veer_of(motion) == pytest.approx(-0.05, abs=0.002)


def test_key_scans_far_apart_do_not_tell():
    motion, _, _ = driven(0.05, seeing=60.0, seconds=60.0, rate=1)
    assert veer_of(motion) == 0.0


def learned(steps, way=0.1, turned=0.0, match=1e-6, last=1e-6, number=None, **kind):
    """The wheels' turn after so many steps of `way` [m], of which they `turned` [rad] nothing.

    The robot turned by `steps`.
    """
    number = records(1, source_kernels.SOURCE) if number is None else number
    if number["unsure"][0] == 0.0:
        number["unsure"] = kernels.VEER**2
    number["told"], number["variance"], number["own"] = turned, 1e-6, 1e-6
    for name, value in kind.items():
        number[name] = value
    for found in steps:
        kernels.calibrate_veer(number[0], way, found, match, last, LAW)
    return number


def told_by(error, unsure):
    """What is learned of a first way: `wrong` for one rad/m, `unsure`."""
    share = unsure / (unsure + error)
    return share, (1.0 - share) * unsure


def test_a_way_tells_once_it_is_three_meters_long():
    assert learned([0.002] * 29)["wrong"][0] == 0.0
    told = learned([0.002] * 30)
    slip = P.turn_slip_way**2 * 3.0
    prior = kernels.VEER**2 + kernels.BEND**2 * 3.0
    share, unsure = told_by((2e-6 + 2.0 * kernels.STEADY**2 + slip) / 3.0**2, prior)
    assert told["wrong"][0] == pytest.approx(0.02 * share, rel=1e-3)
    assert told["unsure"][0] == pytest.approx(unsure, rel=1e-3)
    backwards = learned([0.002] * 30, way=-0.1)
    assert backwards["wrong"][0] == -told["wrong"][0]
    assert backwards["unsure"][0] == told["unsure"][0]


def test_corners_tell_less_than_straight_ways():
    told = learned([0.052] * 30, turned=0.05)
    slip = P.turn_slip_way**2 * 3.0 + (P.turn_scale * 30 * 0.05) ** 2
    prior = kernels.VEER**2 + kernels.BEND**2 * 3.0
    share, unsure = told_by((2e-6 + 2.0 * kernels.STEADY**2 + slip) / 3.0**2, prior)
    assert told["wrong"][0] == pytest.approx(0.02 * share, rel=1e-3)
    assert told["unsure"][0] == pytest.approx(unsure, rel=1e-3)
    there_and_back = learned([0.052, -0.048] * 15 + [0.002], turned=0.0)  # no corner was told
    assert there_and_back["unsure"][0] < 0.1 * unsure


def test_every_way_begins_without_a_turn():
    corner = learned([0.05] * 30, turned=0.05)
    straight = learned([0.002] * 30, number=corner)
    alone = learned([0.002] * 30)
    assert straight["unsure"][0] == pytest.approx(alone["unsure"][0], rel=0.05)
    doubted = learned([0.05] * 10, turned=0.05)
    learned([0.0], number=doubted, match=1.0)
    again = learned([0.002] * 30, number=doubted)
    assert again["wrong"][0] == pytest.approx(alone["wrong"][0], rel=1e-3)


def test_lateness_of_its_ends_makes_a_way_tell_less():
    slip = P.turn_slip_way**2 * 3.0
    prior = kernels.VEER**2 + kernels.BEND**2 * 3.0
    ends = 2e-6 + 2.0 * (kernels.STEADY**2 + 0.2**2)
    share, _ = told_by((ends + slip) / 3.0**2, prior)
    assert learned([0.002] * 30, late=0.2**2)["wrong"][0] == pytest.approx(0.02 * share, rel=1e-3)


@pytest.mark.parametrize(
    "trouble", [{"match": 0.004**2}, {"last": 0.004**2}, {"variance": math.inf}, {"variance": 1e-5}]
)
def test_a_way_begins_anew_where_a_match_is_blind_or_wheels_are_doubted(trouble):
    number = learned([0.002] * 100, **trouble)
    assert number["wrong"][0] == 0.0 and number["way"][0] == 0.0


def test_a_veer_may_change_with_the_way():
    unsure = [float(learned([0.0] * n)["unsure"][0]) for n in (900, 3000)]
    assert unsure[0] == pytest.approx(unsure[1], rel=0.2)
    changed = learned([0.0] * 3000 + [0.001] * 600)["wrong"][0]
    assert changed == pytest.approx(0.01, abs=0.001)


def wheels_at(scale=0.0, veer=0.0):
    """Wheels with what was learned of them, whose last reading was late."""
    wheels = records(3, source_kernels.SOURCE)
    wheels["wrong"] = scale, 0.0, veer
    wheels["late"], wheels["own"] = 1.0, 1.0
    return wheels


def test_what_was_learned_is_taken_out_of_a_step():
    assert source_kernels.corrected(wheels_at(), (1.0, 0.2, 0.3)) == (1.0, 0.2, 0.3)
    step = source_kernels.corrected(wheels_at(0.1, -0.05), (2.0, 0.2, 0.3))
    assert step == pytest.approx((2.2, 0.22, 0.2))


def test_the_robot_is_kept_where_the_wheels_would_count_it():
    wheels = wheels_at(0.1, -0.05)
    at, now = (0.3, -0.2, 0.4), Pose2(0.3, -0.2, 0.4) @ Pose2(1.0, 0.1, 0.2)
    for number, here, there in zip(wheels, at, now, strict=True):
        number["at"], number["now"] = here, there
    step = source_kernels.corrected(wheels, source_kernels.chord(at, now))
    reading_kernels.settle(wheels, step, 1e-3)  # all late: kept is where the step has brought it
    assert wheels["at"] == pytest.approx(tuple(now), abs=1e-9)
