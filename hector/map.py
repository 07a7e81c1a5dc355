"""LogOddsPyramid: the map of Hector SLAM, its occupancy grids and the lines inside its cells."""

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

ROUGH, FINE = 0.05, 0.02  # of a cell: a step below is the last, before lines or a finer level
BLUR = 0.01  # least variance of 1 - M: a wall's ridge of cells is never exact


class LogOddsPyramid:
    """Occupancy grids of one scene at several resolutions, each made from the scans themselves.

    Level 0 is the finest; cell centers of a level lie on every second one of the level below.
    All levels grow together.
    """

    def __init__(self, params: HectorParams) -> None:
        self.params = params
        self.insertions = 0
        self.extent = GridBounds(params.max_cells, params.resolution)
        self._block: int = 1 << (params.levels - 1)
        self._room = GridStorage(params.max_cells, params.resolution, self._block)
        self._update = Update(
            math.log(params.free / (1.0 - params.free)),
            math.log(params.occupied / (1.0 - params.occupied)),
            params.ceiling,
            params.free / (1.0 - params.free),
        )
        self.levels = [self._empty(level) for level in range(params.levels)]
        self.lines = LineMap(params, *self._finest(), map_kernels.FREE)
        self._H = np.zeros((3, 3))
        self._made: dict[int, tuple[tuple[float, ...], ...]] = {}

    def insert(self, scan: EndPoints, pose: Pose2) -> bool:
        """Let a scan taken at `pose` enter every level, and the lines of the finest.

        False if it may not: the map does not grow so far.
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
        known = tuple(prior.pose), prior.information
        solvers, H = self._solvers(scan.n // MIN_USED_BEAMS), self._H
        pose, share, square = match_kernels.climb(
            levels, scan.points, scan.n, tuple(start), known, solvers, H
        )
        return Match(Pose2(*pose), share, self.lines.variance, H / max(square, BLUR))

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
        """The coarsest level: the widest target and the cheapest to search."""
        level = self.levels[-1]
        return LikelihoodField(level.p, level.x0, level.y0, level.resolution)

    def grid(self) -> OccupancyGrid:
        """The finest level, cut to what was observed."""
        return self.snapshot()()

    def snapshot(self) -> Callable[[], OccupancyGrid]:
        """A function that draws the finest level as it stands now, cut to what was observed."""
        level, window = self.levels[0], self._room.window(self.extent.covered)
        log_odds = level.log_odds[window].copy()
        unknown = np.full((1, 1), np.nan, np.float32)
        nothing = OccupancyGrid(unknown, self.params.resolution, (0.0, 0.0))
        return lambda: _drawn(log_odds, window, level) or nothing

    def crop(self, box: Box) -> OccupancyGrid | None:
        """The part of the finest level in a box that was observed, None if nothing was."""
        level, window = self.levels[0], self._room.window(box)
        return _drawn(level.log_odds[window], window, level)

    def _solvers(self, most: int) -> tuple[tuple[float, ...], ...]:
        """`Solver` of each level, finest first; of `most` beams one at least is used."""
        if most not in self._made:
            self._made[most] = tuple(tuple(self._solver(k, most)) for k in range(len(self.levels)))
        return self._made[most]

    def _solver(self, level: int, most: int) -> Solver:
        p, cell = self.params, self.levels[level].resolution
        thinned = MAX_BEAM_STRIDE if p.refine else 2**level  # several beams end in one coarse cell
        stride = max(min(thinned, most), 1)
        tolerance = FINE * cell
        if p.refine and stride > 1:
            tolerance = ROUGH * cell
        elif not p.refine and level == 0:
            tolerance = p.converged
        return Solver(p.steps, p.max_shift, p.max_turn, tolerance, p.damping, stride)

    def _empty(self, level: int) -> Level:
        shape = (self._room.height >> level, self._room.width >> level)
        arrays = zeros(shape, np.float32), zeros(shape, np.float32), zeros(shape, np.int32)
        return Level(*arrays, *self._room.corner, self.params.resolution * 2**level)

    def _finest(self) -> tuple[NDArray[np.float32], tuple[float, float], float]:
        """The finest level as the lines see it."""
        finest = self.levels[0]
        return finest.log_odds, (finest.x0, finest.y0), finest.resolution

    def _cover(self, pose: Pose2, far: float) -> bool:
        """Make every level reach `far` [m] around the pose, if they may grow so far."""
        finest = self.levels[0]
        needed = Box.around(pose.x, pose.y, far + 2.0 * self._block * finest.resolution)
        if not self.extent.admits(needed):
            return False
        added = self._room.reach(needed)
        if added is not None:
            self._grow(*added)
        return True

    def _grow(self, below: int, left: int) -> None:
        old = self.levels
        self.levels = [self._empty(k) for k in range(len(old))]
        for k, (new, level) in enumerate(zip(self.levels, old, strict=True)):
            move(level.log_odds, new.log_odds, below >> k, left >> k)
            move(level.p, new.p, below >> k, left >> k)  # stamps are of one insertion only
        seen, first, _ = self._finest()
        self.lines.move(seen, first, below, left)


def _drawn(
    log_odds: NDArray[np.float32], window: tuple[slice, slice], level: Level
) -> OccupancyGrid | None:
    """The observed part of a window of a level as probabilities, None if nothing was observed."""
    found = observed(log_odds != 0.0, window, (level.x0, level.y0), level.resolution)
    if found is None:
        return None
    log_odds, corner = log_odds[found[0]], found[1]
    p = np.where(log_odds != 0.0, 0.5 + 0.5 * np.tanh(0.5 * log_odds), np.nan)
    return OccupancyGrid(p.astype(np.float32), level.resolution, corner)
