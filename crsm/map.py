"""GreyMap: the global map of CRSM SLAM, its grey levels and the lines inside its cells."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from crsm import map_kernels, match_kernels
from crsm.map_kernels import Grid, Update
from crsm.params import CrsmParams
from slams.cells import GridStorage, move, observed, zeros
from slams.frontend.correlative import LikelihoodField
from slams.grid_bounds import Box, GridBounds
from slams.refine.lines import LineMap
from slams.scan.end_points import EndPoints
from slams.types import OccupancyGrid, Pose2

COARSE = 4  # fine cells along a coarse one: 0.2 m, wide enough to climb from afar
UNKNOWN = 2.0  # passing beams that weigh as much as that nothing is known of a cell


class GreyMap:
    """Grey levels of one scene, fine and coarse, each made from the scans themselves.

    Level 0 is the fine one; both grow together.
    """

    def __init__(self, params: CrsmParams) -> None:
        self.params = params
        self.insertions = 0
        self.extent = GridBounds(params.max_cells, params.cell)
        self._room = GridStorage(params.max_cells, params.cell, COARSE)
        self.levels = [self._blank(1), self._blank(COARSE)]
        self._strokes = np.zeros((1, 5))
        self.lines = LineMap(params, *self._fine(), match_kernels.FREE)

    def insert(self, scan: EndPoints, pose: Pose2) -> bool:
        """Let a scan taken at `pose` enter both grids, and the lines of the fine one.

        False if it may not: the map does not grow so far.
        """
        if not self._cover(pose, scan.radius):
            return False
        self.insertions += 1
        if len(self._strokes) < scan.n:
            self._strokes = np.zeros((scan.n, 5))
        at, mark, ends, p = tuple(pose), self.insertions, self._strokes, self.params
        unknown = UNKNOWN * p.free if p.refine else 0.0  # the paper: one beam whitens a cell
        for grid in self.levels:
            cell = grid.resolution
            update = Update(p.free, p.max_weight, max(p.stroke * cell, scan.noise), unknown)
            count = map_kernels.strokes(scan.points, scan.normals, scan.n, cell, ends)
            map_kernels.blacken(grid, ends, count, at, mark, tuple(update))
            map_kernels.whiten(grid, ends, count, at, tuple(scan.mount), mark, tuple(update))
        if p.refine:
            self.lines.insert(scan, pose)
        return True

    @property
    def empty(self) -> bool:
        """Whether no scan has entered the map."""
        return self.insertions == 0

    def evaluate(self, scan: EndPoints, pose: Pose2) -> tuple[float, float]:
        """Shares of the beams that are inliers at a pose, and that are in conflict with the map."""
        if self.params.refine:
            return self.lines.evaluate(scan, pose)
        fine, at = tuple(self.levels[0]), tuple(pose)
        inliers, conflicts = match_kernels.evaluate(fine, scan.points, scan.n, at)
        return inliers, conflicts

    def likelihood_field(self) -> LikelihoodField:
        """The coarse grid: a wide target and cheap to search."""
        grid = self.levels[1]
        return LikelihoodField(grid.grey, grid.x0, grid.y0, grid.resolution)

    def grid(self) -> OccupancyGrid:
        """The grey levels as probabilities, cut to what was observed."""
        return self.snapshot()()

    def snapshot(self) -> Callable[[], OccupancyGrid]:
        """A function that draws the grey levels as they stand now, cut to what was observed."""
        fine, window = self.levels[0], self._room.window(self.extent.covered)
        cells = fine.grey[window].copy(), fine.weight[window] > 0.0
        unknown = np.full((1, 1), np.nan, np.float32)
        nothing = OccupancyGrid(unknown, self.params.cell, (0.0, 0.0))
        return lambda: _drawn(*cells, window, fine) or nothing

    def crop(self, box: Box) -> OccupancyGrid | None:
        """The part in a box that was observed, None if nothing was."""
        fine, window = self.levels[0], self._room.window(box)
        return _drawn(fine.grey[window], fine.weight[window] > 0.0, window, fine)

    def _blank(self, side: int) -> Grid:
        room, cell = self._room, self.params.cell
        shape = (room.height // side, room.width // side)
        arrays = zeros(shape, np.float32), zeros(shape, np.float32), zeros(shape, np.int32)
        x, y = room.corner
        half = 0.5 * side * cell
        return Grid(*arrays, x + half, y + half, side * cell)

    def _fine(self) -> tuple[NDArray[np.float32], tuple[float, float], float]:
        """The fine grid as the lines see it."""
        grid = self.levels[0]
        return grid.grey, (grid.x0, grid.y0), grid.resolution

    def _cover(self, pose: Pose2, far: float) -> bool:
        """Make the map reach `far` [m] around the pose, if it may grow so far."""
        needed = Box.around(pose.x, pose.y, far + 2.0 * COARSE * self.params.cell)
        if not self.extent.admits(needed):
            return False
        added = self._room.reach(needed)
        if added is not None:
            self._grow(*added)
        return True

    def _grow(self, below: int, left: int) -> None:
        old = self.levels
        self.levels = [self._blank(1), self._blank(COARSE)]
        for new, grid, side in zip(self.levels, old, (1, COARSE), strict=True):
            move(grid.grey, new.grey, below // side, left // side)
            move(grid.weight, new.weight, below // side, left // side)
        seen, first, _ = self._fine()  # stamps are of one insertion only
        self.lines.move(seen, first, below, left)


def _drawn(
    grey: NDArray[np.float32], seen: NDArray[np.bool_], window: tuple[slice, slice], level: Grid
) -> OccupancyGrid | None:
    """The observed part of a window of a level as probabilities, None if nothing was observed."""
    found = observed(seen, window, (level.x0, level.y0), level.resolution)
    if found is None:
        return None
    part, corner = found
    p = np.where(seen[part], 0.5 + 0.5 * grey[part], np.nan)
    return OccupancyGrid(p.astype(np.float32), level.resolution, corner)
