"""GrayMap: the map of CRSM SLAM, grids of gray levels and the lines in the fine cells."""

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

COARSE_FACTOR = 4  # fine cells along the edge of a coarse cell: 0.2 m, to climb from afar
UNKNOWN_WEIGHT = 2.0  # passing beams; weight of the gray level 0 that a cell has at first


class GrayMap:
    """A fine and a coarse grid of gray levels, each updated by every keyframe.

    `levels` are the fine and the coarse grid. Both grow together.
    """

    def __init__(self, params: CrsmParams) -> None:
        self.params = params
        self.insertions = 0
        self.bounds = GridBounds(params.max_cells, params.cell)
        self._storage = GridStorage(params.max_cells, params.cell, COARSE_FACTOR)
        self.levels = [self._new_grid(1), self._new_grid(COARSE_FACTOR)]
        self._segments = np.zeros((1, 5))
        self.lines = LineMap(params, *self._line_grid(), match_kernels.FREE_GRAY)

    def insert(self, scan: EndPoints, pose: Pose2) -> bool:
        """Update both grids and the lines of the fine one with a scan taken at `pose`.

        False if the map may not grow to the scan's end points; then nothing changes.
        """
        if not self._cover(pose, scan.radius):
            return False
        self.insertions += 1
        if len(self._segments) < scan.n:
            self._segments = np.zeros((scan.n, 5))
        at, number, segments, p = tuple(pose), self.insertions, self._segments, self.params
        unknown = UNKNOWN_WEIGHT * p.free if p.refine else 0.0  # the paper: one beam frees a cell
        for grid in self.levels:
            cell = grid.resolution
            update = Update(p.free, p.max_weight, max(p.stroke * cell, scan.noise), unknown)
            n = map_kernels.wall_segments(scan.points, scan.normals, scan.n, cell, segments)
            map_kernels.add_walls(grid, segments, n, at, number, tuple(update))
            mount = tuple(scan.mount)
            map_kernels.add_free_space(grid, segments, n, at, mount, number, tuple(update))
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
        """Gray levels of the coarse grid: its walls are wider, its search is faster."""
        grid = self.levels[1]
        return LikelihoodField(grid.gray, grid.x0, grid.y0, grid.resolution)

    def grid(self) -> OccupancyGrid:
        """Probabilities of the fine grid, cut to the observed cells."""
        return self.snapshot()()

    def snapshot(self) -> Callable[[], OccupancyGrid]:
        """A function that returns the `grid` of now, also after later updates of the map."""
        fine, window = self.levels[0], self._storage.window(self.bounds.covered)
        cells = fine.gray[window].copy(), fine.weight[window] > 0.0
        unknown = np.full((1, 1), np.nan, np.float32)
        nothing = OccupancyGrid(unknown, self.params.cell, (0.0, 0.0))
        return lambda: _occupancy(*cells, window, fine) or nothing

    def crop(self, box: Box) -> OccupancyGrid | None:
        """Probabilities of the fine grid in a box, cut to the observed cells; None without any."""
        fine, window = self.levels[0], self._storage.window(box)
        return _occupancy(fine.gray[window], fine.weight[window] > 0.0, window, fine)

    def _new_grid(self, factor: int) -> Grid:
        """A grid without observations, of cells with so many fine cells along an edge."""
        storage, cell = self._storage, self.params.cell
        shape = (storage.height // factor, storage.width // factor)
        arrays = zeros(shape, np.float32), zeros(shape, np.float32), zeros(shape, np.int32)
        x, y = storage.corner
        half = 0.5 * factor * cell
        return Grid(*arrays, x + half, y + half, factor * cell)

    def _line_grid(self) -> tuple[NDArray[np.float32], tuple[float, float], float]:
        """The fine grid for `LineMap`: gray levels, center of cell [0, 0] [m], cell [m]."""
        grid = self.levels[0]
        return grid.gray, (grid.x0, grid.y0), grid.resolution

    def _cover(self, pose: Pose2, radius: float) -> bool:
        """Make the map cover `radius` [m] around the pose; False if it may not grow so far."""
        needed = Box.around(pose.x, pose.y, radius + 2.0 * COARSE_FACTOR * self.params.cell)
        if not self.bounds.admits(needed):
            return False
        added = self._storage.reach(needed)
        if added is not None:
            self._grow(*added)
        return True

    def _grow(self, below: int, left: int) -> None:
        """Move both grids to the larger storage, by so many fine cells added below and left."""
        old = self.levels
        self.levels = [self._new_grid(1), self._new_grid(COARSE_FACTOR)]
        for new, grid, factor in zip(self.levels, old, (1, COARSE_FACTOR), strict=True):
            move(grid.gray, new.gray, below // factor, left // factor)
            move(grid.weight, new.weight, below // factor, left // factor)
        gray, first, _ = self._line_grid()  # stamps matter within one insertion only
        self.lines.move(gray, first, below, left)


def _occupancy(
    gray: NDArray[np.float32], known: NDArray[np.bool_], window: tuple[slice, slice], level: Grid
) -> OccupancyGrid | None:
    """Probabilities of the observed part of a window of a grid, None if nothing was observed."""
    found = observed(known, window, (level.x0, level.y0), level.resolution)
    if found is None:
        return None
    part, corner = found
    p = np.where(known[part], 0.5 + 0.5 * gray[part], np.nan)
    return OccupancyGrid(p.astype(np.float32), level.resolution, corner)
