"""tsd: corridors, where a scan sees one direction badly."""

import math

import numpy as np
import pytest

from slams.types import IDENTITY, Pose2
from tests.rooms import CORRIDOR, box, laser, scan_at
from tests.tsd.cases import PILLARS, default


@pytest.mark.parametrize("n_beams", [361, 1081])
def test_pillars_of_a_corridor_are_enough_without_odometry(n_beams):
    pillars = [side for x, y in PILLARS for side in box(x, y, x + 0.5, y + 0.3)]
    slam, lidar, rng = default(), laser(n_beams), np.random.default_rng(3)
    for i in range(60):
        walls = np.array([*CORRIDOR, *pillars])
        found = slam.update(scan_at((0.03 * i, 0.0, 0.0), lidar, walls, 0.01, rng, 0.1 * i))
    assert found.x == pytest.approx(1.77, abs=0.2)


def test_few_beams_in_a_bare_ring_are_held_by_wheels():
    """Around a corner of a bare ring: what 45 beams say along a corridor is chance."""
    ring = np.array([*box(-13.0, -8.0, 13.0, 8.0), *box(-15.0, -10.0, 15.0, 10.0)])
    steps = [Pose2(0.08, 0.0, 0.0)] * 168 + [Pose2(0.08, 0.0, -0.08)] * 20
    slam, lidar, rng = default(), laser(45), np.random.default_rng(2)
    at, wheels = Pose2(0.0, 9.0, 0.0), IDENTITY
    off = []
    for i, step in enumerate([IDENTITY, *steps, *[Pose2(0.08, 0.0, 0.0)] * 90]):
        at, wheels = at @ step, wheels @ Pose2(1.005 * step.x, 0.0, 1.01 * step.theta)
        scan = scan_at(at, lidar, ring, noise=0.01, rng=rng, t=0.1 * i, odometry=wheels)
        found = slam.update(scan)
        off.append(math.hypot(found.x - at.x, found.y + 9.0 - at.y))
    assert max(off) < 0.25
