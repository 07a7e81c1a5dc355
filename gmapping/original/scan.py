"""End points of a scan, with the program's beam angles or the laser's."""

from __future__ import annotations

import math

import numpy as np

from slams.scan import scan_kernels as kernels
from slams.types import Floats, Scan


def end_points(scan: Scan, offset: float, max_range: float) -> tuple[Floats, float]:
    """End points (n, 2) x, y [m] in the base frame, and the distance of the farthest [m].

    `offset`: rotation of the beams in beam widths; ranges of at least `max_range` [m] are invalid.
    """
    laser = scan.laser
    angles = laser.angles + offset * abs(laser.angle_increment)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    min_range = math.nextafter(laser.range_min, -math.inf)  # the program also uses range_min itself
    limits = min_range, min(laser.range_max, max_range)
    out = np.empty((4, laser.n_beams))
    n, radius = kernels.end_points(scan.ranges, directions, laser.mount, limits, 0.0, out)
    return np.ascontiguousarray(out[:2, :n].T), radius
