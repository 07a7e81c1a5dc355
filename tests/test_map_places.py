"""Walls of a map stand where they are: not half a cell beside, in x or in y."""

import math

import numpy as np
import pytest

from slams.types import Pose2
from tests.rooms import ALGORITHMS, box, laser, made, scan_at

TURNED = Pose2(0.0, 0.0, 0.1)  # so that walls cross their cells at all places
CORNERS = TURNED.transform(np.array([side[:2] for side in box(-2.5, -2.0, 3.0, 2.5)]))
WALLS = np.array([(*a, *b) for a, b in zip(CORNERS, np.roll(CORNERS, -1, axis=0), strict=True)])


def offsets(points):
    """How far [m] points are from the walls that face along x, and along y, on average."""
    found = ([], [])
    for x0, y0, x1, y1 in WALLS:
        length = math.hypot(x1 - x0, y1 - y0)
        along = np.array([x1 - x0, y1 - y0]) / length
        normal = np.array([-along[1], along[0]])
        axis = int(abs(normal[1]) > abs(normal[0]))
        normal *= np.sign(normal[axis])
        way, off = (points - (x0, y0)) @ along, (points - (x0, y0)) @ normal
        near = (way > 0.3) & (way < length - 0.3) & (np.abs(off) < 0.1)
        assert near.sum() > 20
        found[axis].append(off[near].mean())
    return [float(np.mean(each)) for each in found]


@pytest.mark.parametrize("name", ALGORITHMS)
def test_walls_stand_where_they_are(name):
    slam, rng = made(name), np.random.default_rng(0)
    for k in range(12):
        pose = Pose2(0.04 * k, 0.02 * k, 0.05 * k)
        scan = scan_at(pose, laser(721, fov=2.0 * math.pi * 720 / 721), WALLS, 0.005, rng, 0.1 * k)
        slam.update(scan)
    grid = slam.map()
    iy, ix = np.nonzero(grid.p > 0.5)
    centers = np.stack([ix + 0.5, iy + 0.5], axis=1) * grid.resolution + np.array(grid.origin)
    assert np.abs(offsets(centers)).max() < 0.2 * grid.resolution
