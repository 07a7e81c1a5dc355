"""Pyramid: occupancy grids of one scene at several resolutions, of fixed size."""

from __future__ import annotations

import math

import numpy as np

from hector.original import map_kernels, match_kernels
from hector.original.map_kernels import Level, Update
from hector.original.params import OriginalParams
from hector.original.scan import EndPoints
from slams.types import OccupancyGrid, Pose2


class Pyramid:
    """Grids centered on the start, level 0 is the finest; every scan updates each of them.

    The cell centers of a level are every second center of the level below.
    """

    def __init__(self, params: OriginalParams) -> None:
        self.params = params
        self.insertions = 0
        block = 1 << (params.levels - 1)
        cells = -(-params.map_size // block) * block
        corner = -0.5 * cells * params.resolution
        self._update = Update(
            math.log(params.free / (1.0 - params.free)),
            math.log(params.occupied / (1.0 - params.occupied)),
            params.ceiling,
        )
        self.levels = [self._new_level(k, cells >> k, corner) for k in range(params.levels)]

    def match(self, scan: EndPoints, pose: Pose2) -> Pose2:
        """Gauss-Newton from level to level, coarse to fine: [Kohlbrecher11] sec. IV-C."""
        p = self.params
        for k in reversed(range(p.levels)):
            steps = p.steps_coarse if k else p.steps_fine
            level = self.levels[k]
            pose = match_kernels.gauss_newton(level, scan.points, scan.n, pose, steps, p.max_turn)
        return pose

    def insert(self, scan: EndPoints, pose: Pose2) -> None:
        """Update every level with a scan taken at `pose`."""
        self.insertions += 1
        number, mount = self.insertions, scan.laser.mount
        for level in self.levels:
            map_kernels.insert(level, scan.points, scan.n, pose, mount, number, self._update)

    def occupancy(self) -> OccupancyGrid:
        """The finest level, cut to the observed cells."""
        level = self.levels[0]
        known = level.log_odds != 0.0
        rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
        if rows.size == 0:
            rows = columns = np.zeros(1, np.int64)
        part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        p = np.where(known[part], 0.5 + 0.5 * np.tanh(0.5 * level.log_odds[part]), np.nan)
        corner_x = level.x0 + (float(columns[0]) - 0.5) * level.resolution
        corner_y = level.y0 + (float(rows[0]) - 0.5) * level.resolution
        return OccupancyGrid(p.astype(np.float32), level.resolution, (corner_x, corner_y))

    def _new_level(self, k: int, cells: int, corner: float) -> Level:
        shape = (cells, cells)
        return Level(
            np.zeros(shape, np.float32),
            np.full(shape, 0.5, np.float32),
            np.zeros(shape, np.int32),
            corner,
            corner,
            self.params.resolution * 2**k,
        )
