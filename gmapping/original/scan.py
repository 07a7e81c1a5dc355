"""End points of a scan, with the program's angles or the true ones."""

from __future__ import annotations

import math

import numpy as np

from slams.scan import scan_kernels as kernels
from slams.types import Floats, Scan


def end_points(scan: Scan, offset: float, longest: float) -> tuple[Floats, float]:
    """Points (n, 2) x, y [m] of the base frame, and how far away the farthest is [m].

    `offset` is by how many beam widths the beams are turned; ranges from `longest` [m] on are none.
    """
    laser = scan.laser
    angles = laser.angles + offset * abs(laser.angle_increment)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    near = math.nextafter(laser.range_min, -math.inf)  # the program takes range_min itself, too
    limits, out = kernels.Limits(near, min(laser.range_max, longest)), np.empty((3, laser.n_beams))
    n, far = kernels.end_points(scan.ranges, directions, laser.mount, limits, out)
    return np.ascontiguousarray(out[:2, :n].T), far
