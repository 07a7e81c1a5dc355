"""The map as a grid: the keyframes of the output particle's history, ray cast one by one."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from gmapping.render_kernels import COARSE_BITS, BeamCounts, draw
from slams.cells import GridStorage, move, observed, zeros
from slams.frontend.correlative import LikelihoodField
from slams.grid_bounds import Box
from slams.types import Floats, OccupancyGrid, Pose2

Keyframe = Floats | NDArray[np.float32]

FULL_LIKELIHOOD_HITS = 3.0  # of a coarse cell with likelihood 1


def empty_counts(first: Sequence[int], size: Sequence[int], resolution: float) -> BeamCounts:
    """Counts without any beam, from cell index x, y on; `size` in cells along x, y."""
    (x0, y0), (width, height) = first, size
    hits, visits = (zeros((height, width), np.int32) for _ in range(2))
    coarse_hits = zeros((height >> COARSE_BITS, width >> COARSE_BITS), np.float32)
    return BeamCounts(hits, visits, coarse_hits, x0, y0, resolution)


class Renderer:
    """Stores keyframes and draws them at the poses of a particle's history.

    A keyframe is (n + 1, 2) x, y [m] in the base frame: end points of a scan, then the laser. If
    its pose changes, it is removed and drawn again; `counts` is the sum of what is drawn.
    `resolution` [m] of a cell; the share of hits `occupied` becomes 0.5 in the grid, which has at
    most `max_cells` cells.
    """

    def __init__(self, resolution: float, occupied: float, max_cells: int) -> None:
        self._exponent = math.log(0.5) / math.log(occupied)
        self._storage = GridStorage(max_cells, resolution, 1 << COARSE_BITS)
        self._low, self._high = np.zeros((2, 2), np.int64)  # cells of what was drawn
        self._keyframes: list[Keyframe] = []
        self._poses = np.zeros((64, 3))  # where each keyframe is drawn
        self.counts = self._empty_counts(resolution)

    def add_keyframe(self, keyframe: Keyframe, pose: Pose2) -> None:
        """Store a keyframe, and draw it at a pose."""
        k = len(self._keyframes)
        if k == len(self._poses):
            self._poses = np.concatenate([self._poses, np.zeros_like(self._poses)])
        self._keyframes.append(keyframe)
        self._poses[k] = pose
        self._draw(keyframe, pose, 1)

    def snapshot(self, history: Floats) -> Callable[[], OccupancyGrid]:
        """A function that gives the present map, drawn at the poses (k, 3) of a history.

        Occupancy is a power of hits / visits; the original's threshold becomes 0.5.
        """
        before = self._poses[: len(history)]
        for k in np.flatnonzero((history != before).any(axis=1)).tolist():
            self._draw(self._keyframes[k], Pose2(*before[k].tolist()), -1)
            self._draw(self._keyframes[k], Pose2(*history[k].tolist()), 1)
        before[:] = history
        (x0, y0), (x1, y1) = (cell - self._corner for cell in (self._low, self._high + 1))
        cells = self._counts_in((slice(int(y0), int(y1)), slice(int(x0), int(x1))))
        cells = cells._replace(hits=cells.hits.copy(), visits=cells.visits.copy())
        unknown = np.full((1, 1), np.nan, np.float32)
        nothing = OccupancyGrid(unknown, self.counts.resolution, (0.0, 0.0))
        return lambda: self._occupancy(cells) or nothing

    def crop(self, box: Box) -> OccupancyGrid | None:
        """The part of the drawn map in a box; None if nothing was observed there."""
        return self._occupancy(self._counts_in(self._storage.window(box)))

    def local_map(self, keyframes: list[int]) -> tuple[LikelihoodField, BeamCounts]:
        """Likelihood 1 where beams of some keyframes ended, in double cells, and their counts."""
        edge, poses = self.counts.resolution, [Pose2(*self._poses[k].tolist()) for k in keyframes]
        stored = (self._keyframes[k].astype(np.float64) for k in keyframes)
        scans = [pose.transform(scan) for pose, scan in zip(poses, stored, strict=True)]
        ends = np.concatenate(scans)
        low = np.floor(ends.min(axis=0) / edge).astype(np.int64) >> COARSE_BITS
        high = np.ceil(ends.max(axis=0) / edge).astype(np.int64) >> COARSE_BITS
        first, size = low << COARSE_BITS, (high - low + 2) << COARSE_BITS
        counts = empty_counts(first.tolist(), size.tolist(), edge)
        likelihood = zeros((size[1] // 2, size[0] // 2), np.float32)
        for scan in scans:
            draw(scan, counts, 1)
            x, y = (np.floor(scan[:-1].T / edge + 0.5).astype(np.int64) - first[:, None]) // 2
            likelihood[y, x] = 1.0
        corner = (counts.x0 + 0.5) * edge, (counts.y0 + 0.5) * edge
        return LikelihoodField(likelihood, *corner, 2.0 * edge), counts

    def likelihood_field(self) -> LikelihoodField:
        """Likelihood of walls in coarse cells, for correlative search."""
        edge, counts = self.counts.resolution, self.counts
        # from the center of the first cell in a coarse cell to the center of the coarse cell
        shift = 0.5 * ((1 << COARSE_BITS) - 1)
        corner = (counts.x0 + shift) * edge, (counts.y0 + shift) * edge
        coarse = edge * (1 << COARSE_BITS)
        return LikelihoodField(counts.coarse_hits, *corner, coarse, full=FULL_LIKELIHOOD_HITS)

    @property
    def _corner(self) -> NDArray[np.int64]:
        return np.array((self._storage.x0, self._storage.y0))

    def _counts_in(self, window: tuple[slice, slice]) -> BeamCounts:
        """Hits and visits in a window of rows and columns."""
        (rows, columns), counts = window, self.counts
        x0, y0 = counts.x0 + columns.start, counts.y0 + rows.start
        hits, visits = counts.hits[window], counts.visits[window]
        return counts._replace(hits=hits, visits=visits, x0=x0, y0=y0)

    def _occupancy(self, counts: BeamCounts) -> OccupancyGrid | None:
        """The grid of a window, cut to the observed cells; None if there are none."""
        height, width = counts.visits.shape
        window = slice(counts.y0, counts.y0 + height), slice(counts.x0, counts.x0 + width)
        cut = observed(counts.visits > 0, window, (0.0, 0.0), counts.resolution)
        if cut is None:
            return None
        (rows, columns), corner = cut
        with np.errstate(invalid="ignore"):
            shares = counts.hits[rows, columns] / counts.visits[rows, columns]
        return OccupancyGrid((shares**self._exponent).astype(np.float32), counts.resolution, corner)

    def _draw(self, keyframe: Keyframe, pose: Pose2, times: int) -> None:
        edge, ends = self.counts.resolution, pose.transform(keyframe.astype(np.float64))
        low, high = ends.min(axis=0), ends.max(axis=0)
        self._low = np.minimum(self._low, np.floor(low / edge + 0.5).astype(np.int64))
        self._high = np.maximum(self._high, np.floor(high / edge + 0.5).astype(np.int64))
        added = self._storage.reach(Box(*(low - edge).tolist(), *(high + edge).tolist()))
        if added is not None:
            self._grow(*added)
        draw(ends, self.counts, times)

    def _empty_counts(self, resolution: float) -> BeamCounts:
        storage = self._storage
        first, size = (storage.x0, storage.y0), (storage.width, storage.height)
        return empty_counts(first, size, resolution)

    def _grow(self, below: int, left: int) -> None:
        old, self.counts = self.counts, self._empty_counts(self.counts.resolution)
        move(old.hits, self.counts.hits, below, left)
        move(old.visits, self.counts.visits, below, left)
        move(old.coarse_hits, self.counts.coarse_hits, below >> COARSE_BITS, left >> COARSE_BITS)
