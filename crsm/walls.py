"""WallGrid: the global map in memory, and how it grows."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from crsm.map_kernels import HALO, WEIGHT, WallMap, draw, insert
from crsm.params import CrsmParams
from crsm.scan_kernels import Points
from slams.types import OccupancyGrid, Pose2

START_CELLS = 512  # edge of the first map
SPARE = 64  # cells added beyond what a scan needs
MOST_CELLS = 1 << 23  # 290 m x 290 m with cells of 0.1 m
KNOWN = 0.1  # grey level, either way, from which a cell counts as seen
MOST_PASSED = 8192  # times one drawing notes that a beam went through a wall
BLUR = 1.5  # cells, sigma of the darkness around a wall
_OFF = np.arange(-HALO, HALO + 1)
BLOT = (255.0 * np.exp(-(_OFF[:, None] ** 2 + _OFF**2) / (2.0 * BLUR**2))).astype(np.uint8)
WIDE_BLOT = np.pad(BLOT, 2 * HALO)  # the same among cells that it leaves as they are


class WallGrid:
    """A map centered on the start that grows with the scans put into it."""

    def __init__(self, params: CrsmParams) -> None:
        self.params = params
        half = -0.5 * START_CELLS * params.cell
        self.cells = self._blank(START_CELLS, START_CELLS, (half, half))
        self.is_empty = True
        self._drawings = 0

    def insert(self, points: Points, m: int, pose: Pose2, reach: float) -> bool:
        """Walls of m points seen from `pose` (of the laser); False if they do not fit."""
        if not self._make_room(pose, reach):
            return False
        p = self.params
        cells = np.zeros((m, 2), np.int64)
        rules = (p.gate, p.compat, p.max_weight)
        new = insert(self.cells, points, m, tuple(pose), rules, cells)
        for ix, iy in cells[:new].tolist():
            self._darken(ix, iy)
        self.is_empty = False
        return True

    def draw(self, points: Points, m: int, pose: Pose2) -> int:
        """Whiten the ways of m beams and blacken their ends; returns the walls that are gone.

        Wall elements lose weight when beams go clean through them.
        """
        p = self.params
        self._drawings += 1
        passed = np.zeros((MOST_PASSED, 2), np.int64)
        rules = (self._drawings, -p.density, p.density * p.obstacle_density)
        n = draw(self.cells, points, m, tuple(pose), rules, passed)
        return self._weaken(np.unique(passed[:n], axis=0)) if n else 0

    def _weaken(self, which: NDArray[np.int64]) -> int:
        """Fade the wall elements of cells (n, 2) (ix, iy); returns those gone."""
        ix, iy = which.T
        weight = (1.0 - self.params.fade) * self.cells.wall[iy, ix, WEIGHT] - 1.0
        self.cells.wall[iy, ix, WEIGHT] = np.maximum(weight, 0.0)
        gone = which[weight <= 0.0]
        for jx, jy in gone.tolist():
            self._brighten(jx, jy)
        return len(gone)

    def _darken(self, ix: int, iy: int) -> None:
        """A new wall in cell (ix, iy) darkens the search field around it."""
        around = self.cells.dark[iy - HALO : iy + HALO + 1, ix - HALO : ix + HALO + 1]
        np.maximum(around, BLOT, out=around)

    def _brighten(self, ix: int, iy: int) -> None:
        """The wall of cell (ix, iy) is gone; the search field around it is made anew."""
        low_x, low_y = max(0, ix - 2 * HALO), max(0, iy - 2 * HALO)
        y, x = slice(low_y, iy + 2 * HALO + 1), slice(low_x, ix + 2 * HALO + 1)
        jy, jx = np.nonzero(self.cells.wall[y, x, WEIGHT] > 0.0)
        dy = (iy - low_y - jy)[:, None, None] + _OFF[:, None] + 3 * HALO
        dx = (ix - low_x - jx)[:, None, None] + _OFF + 3 * HALO
        around = self.cells.dark[iy - HALO : iy + HALO + 1, ix - HALO : ix + HALO + 1]
        around[:] = WIDE_BLOT[dy, dx].max(axis=0, initial=0)

    def occupancy(self) -> OccupancyGrid:
        """The grey levels as probabilities, without the unseen rim."""
        grey = self.cells.grey
        seen = np.abs(grey) > KNOWN
        rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
        y0, y1 = (int(rows[0]), int(rows[-1]) + 1) if rows.size else (0, 1)
        x0, x1 = (int(columns[0]), int(columns[-1]) + 1) if columns.size else (0, 1)
        p = (0.5 + 0.5 * grey[y0:y1, x0:x1]).astype(np.float32)
        p[~seen[y0:y1, x0:x1]] = np.nan
        step = self.cells.cell / self.cells.fine
        x, y = self.cells.corner
        return OccupancyGrid(p, step, (x + x0 * step, y + y0 * step))

    def _blank(self, ny: int, nx: int, corner: tuple[float, float]) -> WallMap:
        fine = self.params.fine
        return WallMap(
            np.zeros((ny, nx, 5), np.float32),
            np.zeros((ny, nx), np.uint8),
            np.zeros((ny * fine, nx * fine), np.float32),
            np.zeros((ny * fine, nx * fine), np.int32),
            corner,
            self.params.cell,
            fine,
        )

    def _make_room(self, pose: Pose2, reach: float) -> bool:
        """Grow until everything within `reach` [m] of the pose is inside; False if too large."""
        old = self.cells
        ny, nx = old.dark.shape
        low_x, high_x = self._missing(pose.x - old.corner[0], reach, nx)
        low_y, high_y = self._missing(pose.y - old.corner[1], reach, ny)
        if not (low_x or high_x or low_y or high_y):
            return True
        rows, columns = ny + low_y + high_y, nx + low_x + high_x
        if rows * columns > MOST_CELLS:
            return False
        corner = (old.corner[0] - low_x * old.cell, old.corner[1] - low_y * old.cell)
        new = self._blank(rows, columns, corner)
        new.wall[low_y : low_y + ny, low_x : low_x + nx] = old.wall
        new.dark[low_y : low_y + ny, low_x : low_x + nx] = old.dark
        fine = old.fine
        inner = np.s_[low_y * fine : (low_y + ny) * fine, low_x * fine : (low_x + nx) * fine]
        new.grey[inner] = old.grey
        self.cells = new
        return True

    def _missing(self, at: float, reach: float, n: int) -> tuple[int, int]:
        """Cells to add below and above along one axis."""
        margin = reach + 4.0 * self.cells.cell
        below = math.ceil((margin - at) / self.cells.cell)
        above = math.ceil((at + margin) / self.cells.cell) - n
        return (below + SPARE if below > 0 else 0), (above + SPARE if above > 0 else 0)
