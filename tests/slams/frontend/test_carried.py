"""An algorithm that is carried elsewhere in its own map finds its place again."""

import numpy as np
import pytest

from slams.types import IDENTITY, Pose2, Scan
from tests.rooms import ALGORITHMS, ROOM, laser, made, scan_at

LIDAR = laser(541, range_max=30.0)
FIRST, THERE = Pose2(-3.0, 1.0, 0.0), Pose2(1.5, -2.0, 2.0)
each = pytest.mark.parametrize("name", ALGORITHMS)


def stamped(k, pose, wheels=None):
    noise = np.random.default_rng(k)
    return scan_at(pose, LIDAR, ROOM, 0.01, noise, t=0.1 * k, odometry=wheels)


@each
def test_a_robot_that_was_carried_in_the_dark_is_found_again_if_that_is_wanted(name):
    both = made(name), made(name, relocate=False)
    for k in range(110):
        scan = stamped(k, FIRST @ Pose2(0.05 * k, 0.0, 0.0) if k < 30 else THERE)
        if 30 <= k < 45:
            scan = Scan(scan.t, np.full(541, np.nan, np.float32), LIDAR)
        found = [slam.update(scan) for slam in both]
    assert [slam.report()["relocalized"] for slam in both] == [1, 0]
    assert found[0] == pytest.approx(FIRST.between(THERE), abs=0.03)
    assert both[0].state == "matched"


@each
def test_wheels_that_the_map_refutes_do_not_hold_a_lifted_robot(name):
    slam, wheels, step, pose = made(name), IDENTITY, Pose2(0.05, 0.0, 0.02), FIRST
    for k in range(120):
        slam.update(stamped(k, pose, wheels))
        wheels = wheels @ step  # does not see that the robot is lifted
        pose = THERE if k == 40 else pose @ step
    assert slam.report()["relocalized"] == 1
    assert slam.update(stamped(120, pose)) == pytest.approx(FIRST.between(pose), abs=0.05)
