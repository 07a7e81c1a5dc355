"""Wheels that count too much of every way: learned where scans see for themselves."""

import math

import numpy as np
import pytest

from slams.jit import records
from slams.motion import scale_kernels as kernels
from slams.motion.model import Motion
from slams.motion.params import MotionParams
from slams.motion.source_kernels import SOURCE
from slams.types import Pose2, Scan
from tests.rooms import laser

P = MotionParams()
BEAM = (np.full(10, 2.0, np.float32), laser(10))
SURE, BLIND = 1e-6 * np.eye(3), np.diag([100.0, 100.0, 1e-6])


def driven(counted, seeing, seconds, rate=10, speed=0.5, since=0.0):
    """A straight drive whose wheels count so many meters for one; blind along it after `seeing`.

    And before the time `since`.
    """
    motion, pose = Motion(P), Pose2(0.0, 0.0, 0.0)
    for t in np.arange(0.0, seconds, 1.0 / rate).tolist():
        scan = Scan(t, *BEAM, Pose2(counted * speed * t, 0.0, 0.0))
        predicted = motion.predict(pose, scan).pose
        sees = since <= t < seeing
        pose = Pose2(speed * t, 0.0, 0.0) if sees else predicted
        motion.moved(pose, SURE if sees else BLIND, scan)
    return motion, pose.x - speed * t


@pytest.mark.parametrize("counted", [0.9, 1.05, 1.15])
def test_what_was_learned_of_the_wheels_holds_where_nothing_is_seen(counted):
    motion, off = driven(counted, seeing=20.0, seconds=60.0)
    wrong = motion._wheels.numbers["wrong"][0]
    assert 1.0 + wrong == pytest.approx(1.0 / counted, abs=0.004)
    assert abs(off) < 0.1  # of 20 m; unlearned 1 to 3 m


def test_what_follows_the_wheels_does_not_confirm_them():
    motion, _ = driven(1.1, seeing=0.3, seconds=60.0)
    assert motion._wheels.numbers["wrong"][0] == 0.0
    assert motion._wheels.numbers["unsure"][0] == pytest.approx(kernels.PRIOR**2, rel=1e-2)


def test_wheels_that_have_drawn_a_long_corridor_keep_their_scale():
    for blind, keeps in ((0.7 * kernels.BLIND, False), (1.3 * kernels.BLIND, True)):
        motion, _ = driven(1.1, seeing=80.0, seconds=80.0, since=2.0 * blind)
        assert (motion._wheels.numbers["wrong"][0] == 0.0) == keeps


def test_key_scans_far_apart_do_not_tell():
    motion, _ = driven(1.1, seeing=60.0, seconds=60.0, rate=1)
    assert motion._wheels.numbers["wrong"][0] == 0.0


def learned(ways, match=1e-6, **kind):
    """Wheels after steps of 0.1 m, of which so many meters were gone for one."""
    wheels = records(1, SOURCE)
    wheels["told"], wheels["variance"], wheels["own"] = 0.1, 1e-6, 1e-6
    wheels["unsure"] = kernels.PRIOR**2
    for name, value in kind.items():
        wheels[name] = value
    for gone in ways:
        kernels.calibrate(wheels[0], 0.1 * gone, match, 1e-6)
    return wheels[0]


def test_a_way_tells_once_it_is_a_meter_long():
    assert learned([0.9] * 9)["wrong"] == 0.0
    told = learned([0.9] * 11)
    error = (2e-6 + 2.0 * kernels.SEEN**2) / 1.1**2  # the sum of tenths is just below a meter
    assert told["wrong"] == pytest.approx(-0.1 * 0.03**2 / (0.03**2 + error), rel=1e-2)
    assert told["unsure"] == pytest.approx(0.03**2 * error / (0.03**2 + error), rel=1e-2)
    assert learned([-0.9] * 11, told=-0.1)["wrong"] == told["wrong"]  # backwards


def test_only_what_no_match_saw_was_driven_blind():
    backwards = learned([1.0] * 30, match=0.02**2, told=-0.1)
    assert backwards["blind"] == pytest.approx(3.0)
    assert learned([1.0] * 30, variance=math.inf)["blind"] == 0.0  # wheels that slip


def test_lateness_of_its_ends_makes_a_way_tell_less():
    late = learned([0.9] * 11, late=0.05**2)
    assert -0.03 < late["wrong"] < -0.01


@pytest.mark.parametrize(
    "trouble", [{"match": 0.02**2}, {"variance": math.inf}, {"variance": 1e-5}]
)
def test_a_way_begins_anew_where_a_match_is_blind_or_wheels_are_doubted(trouble):
    number = learned([0.9] * 30, **trouble)
    assert number["wrong"] == 0.0 and number["way"] == 0.0


def test_both_ends_of_a_way_count():
    def unsure(*variances):
        wheels = records(1, SOURCE)
        wheels["told"], wheels["variance"], wheels["own"] = 1.5, 1e-6, 1e-6
        wheels["unsure"] = kernels.PRIOR**2
        kernels.calibrate(wheels[0], 1.5, *variances)
        return wheels["unsure"][0]

    sure, blurred = 1e-8, 0.009**2
    assert unsure(sure, sure) < unsure(sure, blurred) == unsure(blurred, sure)
    assert unsure(blurred, blurred) > unsure(sure, blurred)


def test_a_way_begins_where_a_match_saw():
    wheels = records(1, SOURCE)
    wheels["told"], wheels["variance"], wheels["own"] = 0.1, 1e-6, 1e-6
    kernels.calibrate(wheels[0], 0.1, 1e-6, 0.02**2)
    assert wheels["way"][0] == 0.0
    kernels.calibrate(wheels[0], 0.1, 1e-6, 1e-6)
    assert wheels["way"][0] == 0.1


def test_what_is_strange_is_believed_if_it_stays():
    good = [1.0] * 110
    once, stays = learned(good + [1.5] * 11), learned(good + [1.5] * 110)
    assert abs(once["wrong"]) < 0.05 < once["unsure"] ** 0.5
    assert stays["wrong"] == pytest.approx(0.5, abs=0.02)


def test_a_scale_may_change_with_the_way():
    unsure = [float(learned([1.0] * n)["unsure"]) for n in (1000, 3000)]
    assert unsure[0] == pytest.approx(unsure[1], rel=0.2)
    assert learned([1.0] * 3000 + [0.97] * 400)["wrong"] == pytest.approx(-0.03, abs=0.003)


# the gyro's bias


def turned(bias, seeing, seconds, blind, rate=20, speed=0.3):
    """A drive in a circle with a gyro that is off by `bias` [rad/s]; after `seeing` blind."""
    motion, pose = Motion(P), Pose2(0.0, 0.0, 0.0)
    for t in np.arange(0.0, seconds, 1.0 / rate).tolist():
        turn = 0.2 * t
        true = Pose2(speed / 0.2 * math.sin(turn), speed / 0.2 * (1.0 - math.cos(turn)), turn)
        scan = Scan(t, *BEAM, None, (0.2 + bias) * t)
        predicted = motion.predict(pose, scan).pose
        pose = true if t < seeing else predicted
        motion.moved(pose, SURE if t < seeing else blind, scan)
    return motion, math.remainder(pose.theta - turn, 2.0 * math.pi)


@pytest.mark.parametrize("bias", [-0.02, 0.005])
def test_a_gyros_bias_that_was_learned_holds_where_nothing_is_seen(bias):
    motion, off = turned(bias, 20.0, 60.0, 100.0 * np.eye(3))
    gyro = motion._gyro.numbers
    assert gyro["wrong"][0] == pytest.approx(-bias, abs=5e-4)
    assert abs(off) < 0.02  # unlearned .2 and .8 rad
    assert gyro["own"][0] < P.gyro_noise**2 * 0.05 + (0.5 * P.gyro_bias * 0.05) ** 2 + 1e-6


def test_headings_that_nobody_saw_tell_of_no_bias():
    motion, _ = turned(0.005, 1.0, 30.0, np.diag([1.0, 1.0, 0.01**2]))
    assert motion._gyro.numbers["wrong"][0] == 0.0
    motion, _ = turned(0.005, 30.0, 30.0, SURE, rate=1)
    assert motion._gyro.numbers["wrong"][0] == 0.0  # nor do key scans


def test_a_bias_is_told_once_two_seconds_have_passed():
    gyro = records(1, SOURCE)
    gyro["told"], gyro["variance"], gyro["own"] = 0.02, 1e-6, 1e-6
    gyro["unsure"] = kernels.BIAS**2
    for k in range(40):
        assert (gyro["wrong"][0] != 0.0) == (k >= 20)
        kernels.calibrate_gyro(gyro[0], 0.021, 1e-6, 1e-6, 0.1)
    first = kernels.BIAS**2 + 20 * kernels.DRIFT**2 * 0.1
    ends = (2e-6 + 2.0 * kernels.STEADY**2) / 2.0**2
    one = first * ends / (first + ends) + 20 * kernels.DRIFT**2 * 0.1
    assert gyro["unsure"][0] == pytest.approx(one * ends / (one + ends), rel=0.05)
    assert gyro["wrong"][0] == pytest.approx(0.01 * (1.0 - gyro["unsure"][0] / first), rel=0.01)
    for _ in range(20000):
        kernels.calibrate_gyro(gyro[0], 0.021, 1e-6, 1e-6, 0.1)
    steady = kernels.DRIFT * math.sqrt(2.0 * ends)  # of a bias that walks at random
    assert gyro["unsure"][0] == pytest.approx(steady, rel=0.1)
