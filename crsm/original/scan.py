"""RayPicker: a scan with its end cells and critical rays."""

from __future__ import annotations

import numpy as np

from crsm.original import scan_kernels as kernels
from crsm.original.params import OriginalParams
from slams.types import Floats, Laser, Ranges

MIN_VALID_RANGE = 0.1  # m
JUMP_MARGIN = 0.05  # m below range_max; farther rays are not picked at range jumps
WALL_MARGIN = 0.5  # m below range_max; farther walls get no rays between their ends
MAX_RAY_GAP = 25  # beams from one picked ray to the next
INITIAL_LEVEL = 100.0  # 1; of the ray picker
MIN_RAY_RATIO, MAX_RAY_RATIO = 0.75, 1.25  # of the desired number of rays: the dead band


class RayPicker:
    """Buffers for the scans of one laser; a higher `level` picks fewer rays.

    `d` (n,) [m] are the ranges, 0 without data, `ends` (n, 2) their end cells, `rays` (n_rays, 2)
    those of the critical rays; `density` [m] is the mean difference of neighboring ranges.
    """

    def __init__(self, params: OriginalParams, laser: Laser, level: float = INITIAL_LEVEL) -> None:
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

    def read(self, ranges: Ranges) -> None:
        """Read a scan: remove invalid ranges and pick the critical rays."""
        p, range_max = self._params, self.laser.range_max
        limits = (MIN_VALID_RANGE, range_max, p.cell)
        kernels.clean(ranges, self._directions, limits, self.d, self.ends)
        far = range_max - JUMP_MARGIN
        density, longest = kernels.range_changes(self.d, p.jump, far, self._picked)
        if longest > 0.0:
            far = range_max - WALL_MARGIN
            self._control(kernels.pick_between(self.d, self.level, far, longest, self._picked))
        kernels.fill_gaps(MAX_RAY_GAP, self._picked)
        self.n_rays = kernels.selected(self.d, range_max, self._picked, self.ends, self.rays)
        self.density = float(density)

    def directions(self, heading: float) -> Floats:
        """Unit vectors (n, 2) of the beams at a heading of the laser [rad]."""
        angles = heading + self._angles
        return np.stack([np.cos(angles), np.sin(angles)], axis=1)

    def _control(self, count: int) -> None:
        """Integral controller of the number of rays, with a dead band around the desired number."""
        desired = self._params.picked_rays
        if count > desired * MAX_RAY_RATIO or count < desired * MIN_RAY_RATIO:
            self.level += count - desired
