"""An algorithm that is carried elsewhere in its own map finds its place again."""

import numpy as np
import pytest

from crsm import Crsm, CrsmParams
from gmapping.params import GMappingParams
from gmapping.slam import GMapping
from hector import Hector, HectorParams
from slams.types import IDENTITY, Pose2, Scan
from tests.rooms import ROOM, laser, scan_at
from tsd.params import TsdParams
from tsd.slam import Tsd

LIDAR = laser(541, range_max=30.0)
DEFAULTS = [
    (Hector, HectorParams),
    (Tsd, TsdParams),
    (Crsm, CrsmParams),
    (GMapping, GMappingParams),
]


def stamped(k, pose, wheels=None):
    noise = np.random.default_rng(k)
    return scan_at(pose, LIDAR, ROOM, 0.01, noise, t=0.1 * k, odometry=wheels)


@pytest.mark.parametrize(("kind", "params"), DEFAULTS)
@pytest.mark.parametrize("on", [True, False])
def test_an_algorithm_carried_elsewhere_in_its_map_is_found_again(kind, params, on):
    slam = kind(params(relocate=on))
    for k in range(30):
        slam.update(stamped(k, Pose2(-3.0 + 0.05 * k, 1.0, 0.0)))
    dark = Scan(3.0, np.full(541, np.nan, np.float32), LIDAR)
    for k in range(30, 45):
        slam.update(Scan(0.1 * k, dark.ranges, LIDAR))
    there = Pose2(1.5, -2.0, 2.0)
    for k in range(45, 80):
        found = slam.update(stamped(k, there))
    off = Pose2(-3.0, 1.0, 0.0).between(there)
    assert slam.report()["relocalized"] <= on
    if on:
        assert found == pytest.approx(off, abs=0.03)
        assert slam.state == "matched"


@pytest.mark.parametrize(("kind", "params"), DEFAULTS)
def test_wheels_that_the_map_refutes_do_not_hold_a_lifted_robot(kind, params):
    slam, wheels = kind(params()), IDENTITY
    first, there, step = Pose2(-3.0, 1.0, 0.0), Pose2(1.5, -2.0, 2.0), Pose2(0.05, 0.0, 0.02)
    pose = first
    for k in range(120):
        slam.update(stamped(k, pose, wheels))
        wheels = wheels @ step  # does not see that the robot is lifted
        pose = there if k == 40 else pose @ step
    assert slam.report()["relocalized"] == 1
    assert slam.update(stamped(120, pose)) == pytest.approx(first.between(pose), abs=0.05)
