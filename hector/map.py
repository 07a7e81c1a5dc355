"""LogOddsPyramid: the map of Hector SLAM, its occupancy grids and the lines inside its cells."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hector import line_kernels, map_kernels, match_kernels, surface_kernels
from hector.line_kernels import Fit
from hector.map_kernels import Level, Update
from hector.match_kernels import Prior, Solver, Window
from hector.params import HectorParams
from hector.scan import EndPoints
from hector.surface_kernels import LAYERS, SUMS, Splat, Surface
from slams.extent import Box, Extent
from slams.types import Floats, OccupancyGrid, Pose2

Pool = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int64]]

FIRST_EXTENT = 20.0
MARGIN = 5.0  # [m] beyond what is needed that a map grows at least
SPARE = 0.5  # of its edge, the same: memory that no scan touches costs nothing
POOL = 1 << 14
BAND = 64  # rows that are looked at together


class LogOddsPyramid:
    """Occupancy grids of one scene at several resolutions, each made from the scans themselves.

    Level 0 is the finest; cell centers of a level lie on every second one of the level below.
    All levels grow together.
    """

    def __init__(self, params: HectorParams) -> None:
        self.params = params
        self.insertions = 0
        self.extent = Extent(params.max_cells, params.resolution)
        cells = round(FIRST_EXTENT / params.resolution)
        self._block: int = 1 << (params.levels - 1)
        cells = -(-cells // self._block) * self._block
        self._update = Update(
            math.log(params.free / (1.0 - params.free)),
            math.log(params.occupied / (1.0 - params.occupied)),
            params.ceiling,
        )
        corner = -0.5 * cells * params.resolution
        self.levels = [
            self._empty(level, cells, cells, corner, corner) for level in range(params.levels)
        ]
        rows = (POOL, LAYERS * SUMS), (POOL, 8)
        pool = (np.zeros(rows[0], np.float32), np.zeros(rows[1], np.float32), np.zeros(1, np.int64))
        self.surface = self._surface(pool)

    def insert(self, scan: EndPoints, pose: Pose2) -> bool:
        """Let a scan taken at `pose` enter every level, and the lines of the finest.

        False if it may not: the map does not grow so far.
        """
        if not self._cover(pose, scan.far):
            return False
        self.insertions += 1
        number = self.insertions
        for level in self.levels:
            map_kernels.insert(level, scan.points, scan.n, pose, scan.mount, number, self._update)
        if self.params.refine:
            self._insert_lines(scan, pose)
        return True

    def _insert_lines(self, scan: EndPoints, pose: Pose2) -> None:
        """Hits of a noisy laser lie farther from their wall: more cells learn of them."""
        p = self.params
        reach = max(p.reach, math.ceil(2.0 * scan.noise / p.resolution))
        self._provide(scan.n, reach)
        splat, normals = Splat(reach, p.side, p.weight_cap, self.insertions), scan.find_normals()
        surface_kernels.add_scan(self.surface, scan.points, normals, scan.n, pose, splat)

    def match(
        self, level: int, scan: EndPoints, start: Pose2, prior: Prior, solver: Solver, H: Floats
    ) -> tuple[Pose2, float, float]:
        """Gauss-Newton on the occupancy of one level; pose, mean value, mean square residual."""
        grid = self.levels[level]
        return match_kernels.gauss_newton(grid, scan.points, scan.n, start, prior, solver, H)

    def fit(
        self, scan: EndPoints, start: Pose2, prior: Prior, how: Fit, H: Floats
    ) -> tuple[Pose2, float, float]:
        """Gauss-Newton on the lines; pose, share of beams explained, their mean square [m^2]."""
        points, n = scan.points, scan.n
        return line_kernels.fit(self.surface, points, n, scan.mount, start, prior, how, H)

    def evidence(self, scan: EndPoints, pose: Pose2, softness: float) -> Floats:
        """What each beam says for `pose`: (n,), 1 explained, -1 contradicted, 0 nothing."""
        out, points, n = np.zeros(scan.n), scan.points, scan.n
        if self.params.refine:
            soft = 1.0 / (softness * softness)
            line_kernels.evidence(self.surface, points, n, scan.mount, pose, soft, out)
        else:
            match_kernels.evidence(self.levels[min(1, len(self.levels) - 1)], points, n, pose, out)
        return out

    def search(self, scan: EndPoints, center: Pose2) -> list[Pose2]:
        """The best poses of a window around `center`, best first: one for each turn, the first few.

        On the coarsest level: it is the widest target and the cheapest to search.
        """
        p = self.params
        level = p.levels - 1
        cell, far = self.levels[level].resolution, max(scan.far, 1.0)
        step = min(0.1, 2.0 * cell / far)
        window = Window(round(p.search_distance / cell), round(p.search_angle / step), step)
        out = np.zeros((2 * window.turns + 1, 4))
        stride = max(1, scan.n // 180)
        match_kernels.search(self.levels[level], scan.points, scan.n, stride, center, window, out)
        best = out[np.argsort(-out[:, 3], kind="stable")[: p.search_tries]]
        return [Pose2(*row[:3]) for row in best.tolist()]

    def grid(self) -> OccupancyGrid:
        """The finest level, cut to what was observed."""
        level = self.levels[0]
        seen = level.log_odds != 0.0
        rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
        if rows.size == 0:
            rows = columns = np.zeros(1, np.int64)
        part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        p = np.where(seen[part], 0.5 + 0.5 * np.tanh(0.5 * level.log_odds[part]), np.nan)
        corner_x = level.x0 + (float(columns[0]) - 0.5) * level.resolution
        corner_y = level.y0 + (float(rows[0]) - 0.5) * level.resolution
        return OccupancyGrid(p.astype(np.float32), level.resolution, (corner_x, corner_y))

    def _empty(self, level: int, width: int, height: int, x0: float, y0: float) -> Level:
        shape = (height >> level, width >> level)
        return Level(
            np.zeros(shape, np.float32),
            np.zeros(shape, np.float32),
            np.zeros(shape, np.int32),
            x0,
            y0,
            self.params.resolution * 2**level,
        )

    def _surface(self, pool: Pool) -> Surface:
        finest = self.levels[0]
        index = np.zeros(finest.p.shape, np.int32)
        return Surface(index, *pool, finest.log_odds, finest.x0, finest.y0, finest.resolution)

    def _cover(self, pose: Pose2, far: float) -> bool:
        """Make every level reach `far` [m] around the pose, if they may grow so far."""
        finest = self.levels[0]
        needed = Box.around(pose.x, pose.y, far + 2.0 * self._block * finest.resolution)
        if not self.extent.admits(needed):
            return False
        height, width = finest.p.shape
        high_x = finest.x0 + (width - 1) * finest.resolution
        high_y = finest.y0 + (height - 1) * finest.resolution
        left, right = self._blocks(finest.x0 - needed.x0), self._blocks(needed.x1 - high_x)
        below, above = self._blocks(finest.y0 - needed.y0), self._blocks(needed.y1 - high_y)
        if left or right or below or above:
            self._grow(left, below, width + left + right, height + below + above)
        return True

    def _blocks(self, missing: float) -> int:
        """Cells to add on a side that is `missing` meters short: seldom, and many."""
        if missing <= 0.0:
            return 0
        block = self._block * self.params.resolution
        spare = max(MARGIN, SPARE * len(self.levels[0].p) * self.params.resolution)
        return math.ceil((missing + spare) / block) * self._block

    def _grow(self, left: int, below: int, width: int, height: int) -> None:
        old, index = self.levels, self.surface.slot
        x0 = old[0].x0 - left * old[0].resolution
        y0 = old[0].y0 - below * old[0].resolution
        self.levels = [self._empty(k, width, height, x0, y0) for k in range(len(old))]
        for k, (new, level) in enumerate(zip(self.levels, old, strict=True)):
            _copy(level.log_odds, new.log_odds, below >> k, left >> k)
            _copy(level.p, new.p, below >> k, left >> k)  # stamps are of one insertion only
        self.surface = self._surface((self.surface.sums, self.surface.lines, self.surface.used))
        _copy(index, self.surface.slot, below, left)

    def _provide(self, n: int, reach: int) -> None:
        """Rows of the pool for what one scan may add."""
        surface = self.surface
        most = int(surface.used[0]) + n * (2 * reach + 1) * (2 * self.params.side + 1)
        if most < len(surface.lines):
            return
        rows = 2 * most
        sums, lines = np.zeros((rows, LAYERS * SUMS), np.float32), np.zeros((rows, 8), np.float32)
        sums[: len(surface.sums)], lines[: len(surface.lines)] = surface.sums, surface.lines
        self.surface = surface._replace(sums=sums, lines=lines)


def _copy(source: NDArray[Any], target: NDArray[Any], below: int, left: int) -> None:
    """Copy what is not 0 into an array of zeros: memory that was never touched stays so."""
    for top in range(0, len(source), BAND):
        band = source[top : top + BAND]
        seen = np.concatenate([[False], band.any(axis=0), [False]])
        for first, last in np.flatnonzero(np.diff(seen)).reshape(-1, 2).tolist():
            rows = slice(below + top, below + top + len(band))
            target[rows, left + first : left + last] = band[:, first:last]
