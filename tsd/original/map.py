"""TsdGrid: the published grid, one value per cell, in partitions of 32 x 32 cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slams.grid_bounds import DEFAULT_MAX_CELLS, Box, GridBounds
from slams.types import Floats, OccupancyGrid
from tsd.original import map_kernels as kernels
from tsd.original.map_kernels import BLOCK_SIDE, PARTITION_SIDE, Grid
from tsd.original.scan_kernels import Mask, Sensor

FREE_CELL_PROBABILITY, SURFACE_CELL_PROBABILITY = 0.02, 0.98
N_BLOCKS = PARTITION_SIDE // BLOCK_SIDE  # along the edge of a partition


class TsdGrid:
    """Map of the original code.

    Args:
        cell: edge of a cell [m].
        truncation: largest distance that is kept [m].
        side: cells per edge at the start, a multiple of 32.
        grows: whether the grid grows when the robot comes near its edge.
        max_cells: largest number of cells of the box around the map, if it grows.
    """

    def __init__(
        self,
        cell: float,
        truncation: float,
        side: int,
        grows: bool,
        max_cells: int = DEFAULT_MAX_CELLS,
    ) -> None:
        n = max(side // PARTITION_SIDE, 1)
        cells = n * PARTITION_SIDE
        self._grows = grows
        self.extent = GridBounds(max_cells, cell)
        self.kernel = Grid(
            tsd=np.full((cells, cells), np.nan, np.float32),
            weight=np.zeros((cells, cells), np.float32),
            allocated=np.zeros((n, n), np.bool_),
            emptiness=np.zeros((n, n)),
            near=np.zeros((n * N_BLOCKS, n * N_BLOCKS), np.bool_),
            corner=np.full(2, -0.5 * cells * cell),
            cell=cell,
            truncation=max(truncation, 2.0 * cell),
        )

    def push(self, laser: Floats, ranges: Floats, mask: Mask, sensor: Sensor) -> None:
        """Push a scan taken at the laser's pose (3,)."""
        if self._grows and not self._cover(laser, ranges[mask & np.isfinite(ranges)]):
            return
        kernels.push(self.kernel, laser, ranges, mask, sensor)

    def clear(self, x: float, y: float, half: float) -> None:
        """Mark a square around (x, y) [m] as free; `half` is half of its edge [m]."""
        kernels.clear_box(self.kernel, x - half, y - half, x + half, y + half)

    def occupancy(self) -> OccupancyGrid:
        """Occupied where the field crosses zero, free where positive or empty, nan elsewhere."""
        g = self.kernel
        empty = (g.emptiness > 0.0) & ~g.allocated
        free = np.kron(empty, np.ones((PARTITION_SIDE, PARTITION_SIDE), np.bool_))
        p = np.where(free | (g.tsd > 0.0), np.float32(FREE_CELL_PROBABILITY), np.float32(np.nan))
        p[zero_crossings(g.tsd)] = SURFACE_CELL_PROBABILITY
        return OccupancyGrid(p, g.cell, (float(g.corner[0]), float(g.corner[1])))

    def _cover(self, laser: Floats, ranges: Floats) -> bool:
        g = self.kernel
        reach = float(ranges.max(initial=0.0)) + 1.0
        if not self.extent.admits(Box.around(float(laser[0]), float(laser[1]), reach)):
            return False
        size = g.cell * PARTITION_SIDE
        shape = np.array(g.allocated.shape[::-1])
        low = np.floor((laser[:2] - reach - g.corner) / size).astype(int)
        high = np.ceil((laser[:2] + reach - g.corner) / size).astype(int)
        if (low >= 0).all() and (high <= shape).all():
            return True
        before = np.where(low < 0, shape // 4 - low, 0)
        after = np.where(high > shape, high - shape + shape // 4, 0)
        frame = [(int(before[axis]), int(after[axis])) for axis in (1, 0)]
        cells = [(a * PARTITION_SIDE, b * PARTITION_SIDE) for a, b in frame]
        self.kernel = g._replace(
            tsd=np.pad(g.tsd, cells, constant_values=np.nan),
            weight=np.pad(g.weight, cells),
            allocated=np.pad(g.allocated, frame),
            emptiness=np.pad(g.emptiness, frame),
            near=np.pad(g.near, [(a * N_BLOCKS, b * N_BLOCKS) for a, b in frame]),
            corner=g.corner - before * size,
        )
        return True


def zero_crossings(tsd: NDArray[np.float32]) -> Mask:
    """Cells nearest to the zero between two neighbors of opposite signs: mask as `tsd` (ny, nx)."""
    occupied = np.zeros(tsd.shape, np.bool_)
    for first, second in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1, :], np.s_[1:, :])):
        a, b = tsd[first], tsd[second]
        crossing = (a > 0.0) & (b <= 0.0) | (a <= 0.0) & (b > 0.0)
        closer = np.abs(a) <= np.abs(b)
        occupied[first] |= crossing & closer
        occupied[second] |= crossing & ~closer
    return occupied
