"""TileMap: the maps of all particles in one pool of reference-counted tiles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gmapping.tile_kernels import CELLS, SIDE, Tiles, inherit
from slams.grid_bounds import DEFAULT_MAX_CELLS, Box, GridBounds
from slams.types import Floats, Pose2

MARGIN = 8  # tiles added around what does not fit
MOST_POINTERS = 1 << 28  # of all tables together: 1 GB


class TileMap:
    """One map per particle; equal parts are stored once until one particle writes to them.

    `tiles` is what kernels take; it is replaced when the tables grow, so it is asked for anew
    before every call. The pool is reserved whole, but never touched before a tile is used: memory
    that was not written to costs nothing.
    """

    def __init__(
        self,
        n_particles: int,
        layers: int,
        resolution: float,
        max_tiles: int,
        max_cells: int = DEFAULT_MAX_CELLS,
        depth: int = 4,
    ) -> None:
        most = MOST_POINTERS * CELLS // (n_particles * layers)
        self.extent = GridBounds(min(max_cells, most), resolution)
        self._peak = 0
        self.tiles = Tiles(
            cells=np.empty((max_tiles, CELLS, depth), np.float32),
            tables=np.full((n_particles, layers, 2 * MARGIN, 2 * MARGIN), -1, np.int32),
            references=np.zeros(max_tiles, np.int32),
            free=np.concatenate([[max_tiles], np.arange(max_tiles)[::-1]]).astype(np.int32),
            corner_x=-MARGIN,
            corner_y=-MARGIN,
            resolution=resolution,
        )

    @property
    def used(self) -> int:
        """Tiles in use now."""
        return len(self.tiles.references) - int(self.tiles.free[0])

    @property
    def peak(self) -> int:
        """Most tiles that were ever in use before a resampling, or now."""
        return max(self._peak, self.used)

    @property
    def shared(self) -> float:
        """Share of the particles' tiles that is stored elsewhere already."""
        pointers = int((self.tiles.tables >= 0).sum())
        return 1.0 - self.used / pointers if pointers else 0.0

    @property
    def counts(self) -> dict[str, Any]:
        """What the maps take, and where they might not grow, for a report."""
        tiles = {"particles": len(self.tiles.tables), "tiles": self.used, "tiles_peak": self.peak}
        return tiles | {"tiles_shared": round(self.shared, 3)} | self.extent.counts

    def admits(self, pose: Pose2, far: float) -> bool:
        """Whether the maps may grow to what is at most `far` [m] away from `pose`."""
        return self.extent.admits(Box.around(pose.x, pose.y, far))

    def face(self, heading: float) -> None:
        """Tell layers apart by walls that face `heading` [rad] and its right angles."""
        self.tiles = self.tiles._replace(axis_x=math.cos(heading), axis_y=math.sin(heading))

    def cover(self, low: Floats, high: Floats) -> None:
        """Let the tables reach from `low` to `high`, (x, y) [m] each, if they may grow so far."""
        if not self.extent.admits(Box(*low.tolist(), *high.tolist())):
            return
        edge = SIDE * self.tiles.resolution
        first = np.floor(low / edge).astype(np.int64) - 1
        last = np.floor(high / edge).astype(np.int64) + 1
        tables = self.tiles.tables
        corner = np.array([self.tiles.corner_x, self.tiles.corner_y])
        size = np.array(tables.shape[:1:-1])
        before = np.where(first < corner, corner - first + MARGIN, 0)
        after = np.where(last >= corner + size, last - corner - size + 1 + MARGIN, 0)
        if not (before.any() or after.any()):
            return
        pad = ((0, 0), (0, 0), (before[1], after[1]), (before[0], after[0]))
        grown = np.ascontiguousarray(np.pad(tables, pad, constant_values=-1))
        x, y = (corner - before).tolist()
        self.tiles = self.tiles._replace(tables=grown, corner_x=x, corner_y=y)

    def inherit(self, ancestors: NDArray[np.int64]) -> None:
        """Hand every particle its ancestor's map, without copying tiles; ancestors keep theirs."""
        self._peak = self.peak
        inherit(self.tiles, ancestors)
