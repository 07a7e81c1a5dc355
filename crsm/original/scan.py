"""RayPicker: a scan with its end cells and critical rays."""

from __future__ import annotations

import numpy as np

from crsm.original import scan_kernels as kernels
from crsm.original.params import OriginalParams
from slams.types import Floats, Laser, Ranges

LEAST_RANGE = 0.1  # m
EDGE = 0.05  # m below range_max: no ray is taken as a jump
FAR = 0.5  # m below range_max: a stretch of wall is not searched for more rays
GAP = 25  # rays
FIRST_LEVEL = 100.0  # of the ray picker
DEAD_BAND = (0.75, 1.25)  # of the desired number of rays


class RayPicker:
    """Buffers for the scans of one laser; its `level` steers how many rays are picked.

    `d` (n,) [m] are the ranges, 0 = no data, `ends` (n, 2) their end cells, `rays` (n_rays, 2) the
    critical ones; `density` [m] is the mean difference of neighboring ranges.
    """

    def __init__(self, params: OriginalParams, laser: Laser, level: float = FIRST_LEVEL) -> None:
        n = laser.n_beams
        self.laser = laser
        self.level = level
        self.density = 0.0
        self.n_rays = 0
        self.d = np.zeros(n)
        self.ends = np.zeros((n, 2), np.int64)
        self.rays = np.zeros((n, 2), np.float32)
        single = np.float32  # the program's angles are of single precision
        beams = np.arange(n).astype(single)
        self._angles = (single(laser.angle_min) + beams * single(laser.angle_increment)).astype(
            np.float64
        )
        self._directions = self.directions(0.0)
        self._params = params
        self._picked = np.zeros(n, np.bool_)

    def look(self, ranges: Ranges) -> None:
        """Take a scan: clean it and pick its critical rays."""
        p, range_max = self._params, self.laser.range_max
        limits = (LEAST_RANGE, range_max, p.cell)
        kernels.clean(ranges, self._directions, limits, self.d, self.ends)
        density, longest = kernels.range_changes(self.d, p.jump, range_max - EDGE, self._picked)
        if longest > 0.0:
            far = range_max - FAR
            self._steer(kernels.picked_between(self.d, self.level, far, longest, self._picked))
        kernels.fill_gaps(GAP, self._picked)
        self.n_rays = kernels.selected(self.d, range_max, self._picked, self.ends, self.rays)
        self.density = float(density)

    def directions(self, heading: float) -> Floats:
        """Unit vectors (n, 2) of the beams of a laser with this heading [rad]."""
        angles = heading + self._angles
        return np.stack([np.cos(angles), np.sin(angles)], axis=1)

    def _steer(self, count: int) -> None:
        """Integral controller with a dead band around the desired number of rays."""
        excess = count - self._params.picked_rays
        low, high = (self._params.picked_rays * share for share in DEAD_BAND)
        if count > high or count < low:
            self.level += excess
