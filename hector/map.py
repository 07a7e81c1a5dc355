"""LogOddsPyramid: the map of Hector SLAM, occupancy grids and the lines in the finest cells."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hector import map_kernels, match_kernels
from hector.map_kernels import Level, Update
from hector.match_kernels import Solver
from hector.params import HectorParams
from slams.cells import GridStorage, move, observed, zeros
from slams.frontend.correlative import LikelihoodField
from slams.geometry import Prior
from slams.grid_bounds import Box, GridBounds
from slams.refine.lines import MAX_BEAM_STRIDE, MIN_USED_BEAMS, LineMap, Match
from slams.scan.end_points import EndPoints
from slams.types import OccupancyGrid, Pose2

LEVEL_TOLERANCE = 0.02  # cell; a shorter Gauss-Newton step is the last one on a level
TOLERANCE_BEFORE_LINES = 0.05  # cell; the same where the fit to lines follows
MIN_RESIDUAL_VARIANCE = 0.01  # 1, of 1 - M; the ridge of a wall is exact to a part of a cell only


class LogOddsPyramid:
    """Occupancy grids of the environment at several resolutions, each updated by every keyframe.

    Level 0 is the finest. The cell centers of a level are every second center of the level below.
    All levels grow together.
    """

    def __init__(self, params: HectorParams) -> None:
        self.params = params
        self.insertions = 0
        self.bounds = GridBounds(params.max_cells, params.resolution)
        self._block: int = 1 << (params.levels - 1)
        self._storage = GridStorage(params.max_cells, params.resolution, self._block)
        self._update = Update(
            math.log(params.free / (1.0 - params.free)),
            math.log(params.occupied / (1.0 - params.occupied)),
            params.ceiling,
        )
        self.levels = [self._new_level(level) for level in range(params.levels)]
        self.lines = LineMap(params, *self._line_grid(), map_kernels.FREE_LOG_ODDS)
        self._H = np.zeros((3, 3))
        self._solver_cache: dict[int, tuple[tuple[float, ...], ...]] = {}

    def insert(self, scan: EndPoints, pose: Pose2) -> bool:
        """Update every level and the lines of the finest with a scan taken at `pose`.

        False if the map may not grow to the scan's end points; then nothing changes.
        """
        if not self._cover(pose, scan.radius):
            return False
        self.insertions += 1
        number = self.insertions
        for level in self.levels:
            map_kernels.insert(level, scan.points, scan.n, pose, scan.mount, number, self._update)
        if self.params.refine:
            self.lines.insert(scan, pose)
        return True

    def climb(self, scan: EndPoints, start: Pose2, prior: Prior) -> Match:
        """Gauss-Newton on the occupancy, coarse to fine: [Kohlbrecher11] sec. IV-C."""
        levels = tuple(map(tuple, self.levels))
        prior_tuple = tuple(prior.pose), prior.information
        solvers, H = self._solvers(scan.n // MIN_USED_BEAMS), self._H
        pose, score, mean_square = match_kernels.climb(
            levels, scan.points, scan.n, tuple(start), prior_tuple, solvers, H
        )
        information = H / max(mean_square, MIN_RESIDUAL_VARIANCE)
        return Match(Pose2(*pose), score, self.lines.variance, information)

    @property
    def empty(self) -> bool:
        """Whether no scan has entered the map."""
        return self.insertions == 0

    def evaluate(self, scan: EndPoints, pose: Pose2) -> tuple[float, float]:
        """Shares of the beams that are inliers at a pose, and that are in conflict with the map."""
        if self.params.refine:
            return self.lines.evaluate(scan, pose)
        level = self.levels[min(1, len(self.levels) - 1)]
        return match_kernels.evaluate(level, scan.points, scan.n, pose)

    def likelihood_field(self) -> LikelihoodField:
        """Occupancy of the coarsest level: its walls are the widest, its search is the fastest."""
        level = self.levels[-1]
        return LikelihoodField(level.p, level.x0, level.y0, level.resolution)

    def grid(self) -> OccupancyGrid:
        """Occupancy of the finest level, cut to the observed cells."""
        return self.snapshot()()

    def snapshot(self) -> Callable[[], OccupancyGrid]:
        """A function that returns the `grid` of now, also after later updates of the map."""
        level, window = self.levels[0], self._storage.window(self.bounds.covered)
        log_odds = level.log_odds[window].copy()
        unknown = np.full((1, 1), np.nan, np.float32)
        nothing = OccupancyGrid(unknown, self.params.resolution, (0.0, 0.0))
        return lambda: _occupancy(log_odds, window, level) or nothing

    def crop(self, box: Box) -> OccupancyGrid | None:
        """Occupancy of the finest level in a box, cut to the observed cells; None without any."""
        level, window = self.levels[0], self._storage.window(box)
        return _occupancy(level.log_odds[window], window, level)

    def _solvers(self, max_stride: int) -> tuple[tuple[float, ...], ...]:
        """`Solver` of each level as a tuple, finest first."""
        if max_stride not in self._solver_cache:
            solvers = (self._solver(k, max_stride) for k in range(len(self.levels)))
            self._solver_cache[max_stride] = tuple(map(tuple, solvers))
        return self._solver_cache[max_stride]

    def _solver(self, level: int, max_stride: int) -> Solver:
        p, cell = self.params, self.levels[level].resolution
        thinned = MAX_BEAM_STRIDE if p.refine else 2**level  # several beams end in one coarse cell
        stride = max(min(thinned, max_stride), 1)
        tolerance = LEVEL_TOLERANCE * cell
        if p.refine and stride > 1:
            tolerance = TOLERANCE_BEFORE_LINES * cell
        elif not p.refine and level == 0:
            tolerance = p.converged
        return Solver(p.steps, p.max_shift, p.max_turn, tolerance, p.damping, stride)

    def _new_level(self, level: int) -> Level:
        """A level without observations, as large as the storage."""
        shape = (self._storage.height >> level, self._storage.width >> level)
        arrays = zeros(shape, np.float32), zeros(shape, np.float32), zeros(shape, np.int32)
        return Level(*arrays, *self._storage.corner, self.params.resolution * 2**level)

    def _line_grid(self) -> tuple[NDArray[np.float32], tuple[float, float], float]:
        """The finest level for `LineMap`: log-odds, center of cell [0, 0] [m], cell [m]."""
        finest = self.levels[0]
        return finest.log_odds, (finest.x0, finest.y0), finest.resolution

    def _cover(self, pose: Pose2, radius: float) -> bool:
        """Make every level cover `radius` [m] around the pose; False if it may not grow so far."""
        finest = self.levels[0]
        needed = Box.around(pose.x, pose.y, radius + 2.0 * self._block * finest.resolution)
        if not self.bounds.admits(needed):
            return False
        added = self._storage.reach(needed)
        if added is not None:
            self._grow(*added)
        return True

    def _grow(self, below: int, left: int) -> None:
        """Move all levels to the larger storage, by so many finest cells added below and left."""
        old = self.levels
        self.levels = [self._new_level(k) for k in range(len(old))]
        for k, (new, level) in enumerate(zip(self.levels, old, strict=True)):
            move(level.log_odds, new.log_odds, below >> k, left >> k)
            move(level.p, new.p, below >> k, left >> k)  # stamps matter within one insertion only
        log_odds, first, _ = self._line_grid()
        self.lines.move(log_odds, first, below, left)


def _occupancy(
    log_odds: NDArray[np.float32], window: tuple[slice, slice], level: Level
) -> OccupancyGrid | None:
    """Probabilities of the observed part of a window of a level, None if nothing was observed."""
    found = observed(log_odds != 0.0, window, (level.x0, level.y0), level.resolution)
    if found is None:
        return None
    log_odds, corner = log_odds[found[0]], found[1]
    p = np.where(log_odds != 0.0, 0.5 + 0.5 * np.tanh(0.5 * log_odds), np.nan)
    return OccupancyGrid(p.astype(np.float32), level.resolution, corner)
