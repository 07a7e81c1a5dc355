"""The map as a grid: the reported particle's history, ray cast keyframe by keyframe."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from gmapping.render_kernels import COARSE, Counts, draw
from slams.cells import GridStorage, move, observed, zeros
from slams.frontend.correlative import LikelihoodField
from slams.grid_bounds import Box
from slams.types import Floats, OccupancyGrid, Pose2

Keyframe = Floats | NDArray[np.float32]

SURE = 3.0  # hits from which a coarse cell is a wall


def blank(first: Sequence[int], size: Sequence[int], resolution: float) -> Counts:
    """Counts of cells that no beam came by, from that of index x, y on; `size` along x, y."""
    (x0, y0), (width, height) = first, size
    shapes = (height, width), (height, width), (height >> COARSE, width >> COARSE)
    hits, visits, walls = (zeros(shape, np.int32) for shape in shapes)
    return Counts(hits, visits, walls, x0, y0, resolution)


def walls(counts: Counts) -> LikelihoodField:
    """Where beams ended, in cells twice as wide, for correlative search."""
    edge, (height, width) = counts.resolution, counts.hits.shape
    pairs = counts.hits.reshape(height // 2, 2, width // 2, 2)
    likelihood = np.asarray(pairs.any(axis=(1, 3)), np.float32)
    return LikelihoodField(
        likelihood, (counts.x0 + 0.5) * edge, (counts.y0 + 0.5) * edge, 2.0 * edge
    )


class Renderer:
    """Keeps the keyframes, and draws them at the poses that a particle's history gives them.

    A keyframe is (n + 1, 2) x, y [m] in the base frame: end points of a scan, then the laser. One
    whose pose has changed is taken back and drawn anew; `counts` has what is drawn now.

    Args:
        resolution: edge of a cell [m].
        occupied: share of hits above which a cell is a wall: 0.5 in the grid.
        max_cells: of the map.
    """

    def __init__(self, resolution: float, occupied: float, max_cells: int) -> None:
        self._power = math.log(0.5) / math.log(occupied)
        self._room = GridStorage(max_cells, resolution, 1 << COARSE)
        self._low, self._high = np.zeros((2, 2), np.int64)  # cells that were needed, both included
        self._scans: list[Keyframe] = []
        self._drawn = np.zeros((64, 3))  # where each of them is drawn
        self.counts = self._empty(resolution)

    def keep(self, scan: Keyframe, pose: Pose2) -> None:
        """Keep a keyframe, and draw it at a pose."""
        k = len(self._scans)
        if k == len(self._drawn):
            self._drawn = np.concatenate([self._drawn, np.zeros_like(self._drawn)])
        self._scans.append(scan)
        self._drawn[k] = pose
        self._add(scan, pose, 1)

    def snapshot(self, history: Floats) -> Callable[[], OccupancyGrid]:
        """A function that draws the map at the poses (k, 3) of a history as it stands now.

        Occupancy of the cells, from hits and visits; 0.5 is the original's threshold.
        """
        before = self._drawn[: len(history)]
        for k in np.flatnonzero((history != before).any(axis=1)).tolist():
            self._add(self._scans[k], Pose2(*before[k].tolist()), -1)
            self._add(self._scans[k], Pose2(*history[k].tolist()), 1)
        before[:] = history
        (x0, y0), (x1, y1) = (cell - self._corner for cell in (self._low, self._high + 1))
        part = self._part((slice(int(y0), int(y1)), slice(int(x0), int(x1))))
        part = part._replace(hits=part.hits.copy(), visits=part.visits.copy())
        unknown = np.full((1, 1), np.nan, np.float32)
        nothing = OccupancyGrid(unknown, self.counts.resolution, (0.0, 0.0))
        return lambda: self._shares(part) or nothing

    def crop(self, box: Box) -> OccupancyGrid | None:
        """The part in a box of what is drawn now, None if nothing was observed there."""
        return self._shares(self._part(self._room.window(box)))

    def only(self, scans: list[int]) -> Counts:
        """What some kept scans alone have seen, from where they are drawn."""
        drawn, edge = self._drawn, self.counts.resolution
        seen = [
            Pose2(*drawn[k].tolist()).transform(self._scans[k].astype(np.float64)) for k in scans
        ]
        ends = np.concatenate(seen)
        low = np.floor(ends.min(axis=0) / edge).astype(np.int64) >> COARSE
        high = np.ceil(ends.max(axis=0) / edge).astype(np.int64) >> COARSE
        counts = blank((low << COARSE).tolist(), ((high - low + 2) << COARSE).tolist(), edge)
        for scan in seen:
            draw(scan, counts, 1)
        return counts

    def likelihood_field(self) -> LikelihoodField:
        """Likelihood of walls in coarse cells, for correlative search."""
        edge, counts = self.counts.resolution * (1 << COARSE), self.counts
        (x0, y0), (x1, y1) = self._low - self._corner, self._high - self._corner
        first_x, first_y = int(x0) >> COARSE, int(y0) >> COARSE
        walls = counts.walls[first_y : (y1 >> COARSE) + 1, first_x : (x1 >> COARSE) + 1]
        likelihood = np.minimum(walls / np.float32(SURE), np.float32(1.0))
        shift = 0.5 * ((1 << COARSE) - 1) * counts.resolution  # of the first cell in a coarse one
        x = first_x * edge + counts.x0 * counts.resolution + shift
        y = first_y * edge + counts.y0 * counts.resolution + shift
        return LikelihoodField(likelihood, x, y, edge)

    @property
    def _corner(self) -> NDArray[np.int64]:
        return np.array((self._room.x0, self._room.y0))

    def _part(self, window: tuple[slice, slice]) -> Counts:
        """Hits and visits in some rows and columns."""
        (rows, columns), counts = window, self.counts
        x0, y0 = counts.x0 + columns.start, counts.y0 + rows.start
        hits, visits = counts.hits[window], counts.visits[window]
        return counts._replace(hits=hits, visits=visits, x0=x0, y0=y0)

    def _shares(self, part: Counts) -> OccupancyGrid | None:
        """The map of a part, cut to what was observed; None if nothing was."""
        height, width = part.visits.shape
        window = slice(part.y0, part.y0 + height), slice(part.x0, part.x0 + width)
        found = observed(part.visits > 0, window, (0.0, 0.0), part.resolution)
        if found is None:
            return None
        (rows, columns), corner = found
        with np.errstate(invalid="ignore"):
            shares = part.hits[rows, columns] / part.visits[rows, columns]
        return OccupancyGrid((shares**self._power).astype(np.float32), part.resolution, corner)

    def _add(self, scan: Keyframe, pose: Pose2, times: int) -> None:
        edge, ends = self.counts.resolution, pose.transform(scan.astype(np.float64))
        low, high = ends.min(axis=0), ends.max(axis=0)
        self._low = np.minimum(self._low, np.floor(low / edge + 0.5).astype(np.int64))
        self._high = np.maximum(self._high, np.floor(high / edge + 0.5).astype(np.int64))
        added = self._room.reach(Box(*(low - edge).tolist(), *(high + edge).tolist()))
        if added is not None:
            self._grow(*added)
        draw(ends, self.counts, times)

    def _empty(self, resolution: float) -> Counts:
        room = self._room
        return blank((room.x0, room.y0), (room.width, room.height), resolution)

    def _grow(self, below: int, left: int) -> None:
        old, self.counts = self.counts, self._empty(self.counts.resolution)
        move(old.hits, self.counts.hits, below, left)
        move(old.visits, self.counts.visits, below, left)
        move(old.walls, self.counts.walls, below >> COARSE, left >> COARSE)
