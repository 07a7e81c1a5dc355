"""The map as a grid: the reported particle's history, ray cast keyframe by keyframe."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gmapping.render_kernels import COARSE, Counts, draw
from slams.cells import Room, move, zeros
from slams.frontend.correlative import Lookup
from slams.grid_bounds import DEFAULT_MAX_CELLS, Box
from slams.types import Floats, OccupancyGrid, Pose2

Ints = NDArray[np.int32]

FULL = 1 << COARSE  # cells to the edge of a coarse one
SURE = 3.0  # hits from which a coarse cell is a wall


class Ray(NamedTuple):
    """End points (n, 2 or more) x, y [m] of a scan and the laser (1, 2), in the base frame."""

    points: Floats | NDArray[np.float32]
    sensor: Floats

    def seen_from(self, pose: Pose2) -> tuple[Floats, Floats]:
        """Both in the frame that `pose` stands in."""
        points = self.points[:, :2].astype(np.float64)
        return pose.transform(points), pose.transform(self.sensor)


def walls(counts: Counts) -> Lookup:
    """Where beams ended, in cells twice as wide, for correlative search."""
    edge, (height, width) = counts.resolution, counts.hits.shape
    pairs = counts.hits.reshape(height // 2, 2, width // 2, 2)
    likelihood = np.asarray(pairs.any(axis=(1, 3)), np.float32)
    return Lookup(likelihood, (counts.x0 + 0.5) * edge, (counts.y0 + 0.5) * edge, 2.0 * edge)


class Renderer:
    """Keeps the keyframes, and draws them at the poses that a particle's history gives them.

    A scan whose pose has changed is taken back and drawn anew; `counts` has what is drawn now.

    Args:
        resolution: edge of a cell [m].
        occupied: share of hits above which a cell is a wall: 0.5 in the grid.
        max_cells: of the map.
    """

    def __init__(
        self, resolution: float, occupied: float, max_cells: int = DEFAULT_MAX_CELLS
    ) -> None:
        self._power = math.log(0.5) / math.log(occupied)
        self._room = Room(max_cells, resolution, 1 << COARSE)
        self._low, self._high = np.zeros((2, 2), np.int64)  # cells that were needed, both included
        self._scans: list[Ray] = []
        self._drawn = np.empty((64, 3))  # where each of them is drawn; nan: nowhere yet
        self._n_final = 0  # scans that are drawn for good
        self.counts = self._empty(resolution)

    def keep(self, scan: Ray, pose: Pose2 | None = None) -> None:
        """Keep a keyframe; it is drawn at once if it has a pose."""
        k = len(self._scans)
        if k == len(self._drawn):
            self._drawn = np.concatenate([self._drawn, np.empty_like(self._drawn)])
        self._scans.append(scan)
        self._drawn[k] = np.nan
        if pose is not None:
            self._move(k, pose)

    def draw(self, scan: Ray, pose: Floats) -> None:
        """Draw a keyframe for good, at a pose (3,) that no resampling can change; before any kept.

        Nothing of it is kept.
        """
        self._add(scan, Pose2(*pose.tolist()), 1)
        self._n_final += 1

    def snapshot(self, history: Floats) -> Callable[[], OccupancyGrid]:
        """A function that draws the map at the poses (k, 3) of a history as it stands now.

        Occupancy of the cells, from hits and visits; 0.5 is the original's threshold.
        """
        poses = history[self._n_final :]
        moved = np.flatnonzero((poses != self._drawn[: len(poses)]).any(axis=1))
        for k in moved.tolist():
            self._move(k, Pose2(*poses[k].tolist()))
        part = self._part(*self._low.tolist(), *(self._high + 1).tolist())
        hits, visits = (cells.copy() for cells in part[:2])
        return lambda: self._shares(hits, visits, part[2])

    def cut(self, box: Box) -> OccupancyGrid | None:
        """The part in a box of what is drawn now, None if nothing was observed there."""
        rows, columns = self._room.window(box)
        x0, y0 = self._room.x0, self._room.y0
        low = np.maximum(self._low, (columns.start + x0, rows.start + y0))
        high = np.minimum(self._high + 1, (columns.stop + x0, rows.stop + y0))
        if (low >= high).any():
            return None
        grid = self._shares(*self._part(*low.tolist(), *high.tolist()))
        return None if np.isnan(grid.p).all() else grid

    def drawn_near(self, pose: Pose2, radius: float, end: int) -> list[int]:
        """Numbers of those of the first `end` kept scans that are drawn within a radius [m]."""
        away = np.hypot(*(self._drawn[: min(end, len(self._scans)), :2] - np.array(pose[:2])).T)
        near: list[int] = np.flatnonzero(away < radius).tolist()
        return near

    def only(self, scans: list[int]) -> Counts:
        """What some kept scans alone have seen, from where they are drawn."""
        drawn, edge = self._drawn, self.counts.resolution
        rays = [self._scans[k].seen_from(Pose2(*drawn[k].tolist())) for k in scans]
        ends = np.concatenate([part for ray in rays for part in ray])
        low = np.floor(ends.min(axis=0) / edge).astype(np.int64) >> COARSE
        high = np.ceil(ends.max(axis=0) / edge).astype(np.int64) >> COARSE
        width, height = (high - low + 2).tolist()
        hits, visits = np.zeros((2, height * FULL, width * FULL), np.int32)
        coarse = np.zeros((height, width), np.int32)
        x0, y0 = (low << COARSE).tolist()
        counts = Counts(hits, visits, coarse, x0, y0, edge)
        for points, sensor in rays:
            draw(points, sensor[0], counts, 1)
        return counts

    def lookup(self) -> Lookup:
        """Likelihood of walls in coarse cells, for correlative search."""
        edge, counts = self.counts.resolution * (1 << COARSE), self.counts
        (x0, y0), (x1, y1) = self._low - self._corner, self._high - self._corner
        first_x, first_y = int(x0) >> COARSE, int(y0) >> COARSE
        walls = counts.walls[first_y : (y1 >> COARSE) + 1, first_x : (x1 >> COARSE) + 1]
        likelihood = np.minimum(walls / np.float32(SURE), np.float32(1.0))
        shift = 0.5 * ((1 << COARSE) - 1) * counts.resolution  # of the first cell in a coarse one
        x = first_x * edge + counts.x0 * counts.resolution + shift
        y = first_y * edge + counts.y0 * counts.resolution + shift
        return Lookup(likelihood, x, y, edge)

    @property
    def _corner(self) -> NDArray[np.int64]:
        return np.array((self._room.x0, self._room.y0))

    def _part(self, x0: int, y0: int, x1: int, y1: int) -> tuple[Ints, Ints, tuple[int, int]]:
        """Hits and visits of the cells from x0, y0 up to before x1, y1, and the first of them."""
        u, v = self._corner.tolist()
        window = np.s_[y0 - v : y1 - v, x0 - u : x1 - u]
        return self.counts.hits[window], self.counts.visits[window], (x0, y0)

    def _shares(self, hits: Ints, visits: Ints, first: tuple[int, int]) -> OccupancyGrid:
        """The map of a part."""
        edge = self.counts.resolution
        with np.errstate(invalid="ignore"):
            shares = hits / visits
        corner = (first[0] - 0.5) * edge, (first[1] - 0.5) * edge
        return OccupancyGrid((shares**self._power).astype(np.float32), edge, corner)

    def _move(self, k: int, pose: Pose2) -> None:
        """Draw a kept scan at a pose, and no longer where it was."""
        ray, before = self._scans[k], Pose2(*self._drawn[k].tolist())
        if not math.isnan(before.x):
            self._add(ray, before, -1)
        self._add(ray, pose, 1)
        self._drawn[k] = pose

    def _add(self, ray: Ray, pose: Pose2, times: int) -> None:
        points, sensor = ray.seen_from(pose)
        edge, ends = self.counts.resolution, np.concatenate([points, sensor])
        low, high = ends.min(axis=0), ends.max(axis=0)
        self._low = np.minimum(self._low, np.floor(low / edge + 0.5).astype(np.int64))
        self._high = np.maximum(self._high, np.floor(high / edge + 0.5).astype(np.int64))
        added = self._room.reach(Box(*(low - edge).tolist(), *(high + edge).tolist()))
        if added is not None:
            self._grow(*added)
        draw(points, sensor[0], self.counts, times)

    def _empty(self, resolution: float) -> Counts:
        shape = self._room.height, self._room.width
        coarse = shape[0] >> COARSE, shape[1] >> COARSE
        arrays = zeros(shape, np.int32), zeros(shape, np.int32), zeros(coarse, np.int32)
        return Counts(*arrays, self._room.x0, self._room.y0, resolution)

    def _grow(self, below: int, left: int) -> None:
        old, self.counts = self.counts, self._empty(self.counts.resolution)
        move(old.hits, self.counts.hits, below, left)
        move(old.visits, self.counts.visits, below, left)
        move(old.walls, self.counts.walls, below >> COARSE, left >> COARSE)
