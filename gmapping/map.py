"""TileMap: the maps of all particles in one pool of reference-counted tiles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gmapping.tile_kernels import CELLS, SIDE, Tiles, inherit
from slams.cells import GridStorage, move, zeros
from slams.grid_bounds import DEFAULT_MAX_CELLS, Box, GridBounds
from slams.types import Floats, Pose2

MOST_POINTERS = 1 << 28  # of all tables together: 1 GB


class TileMap:
    """One map per particle; equal parts are stored once until one particle writes to them.

    `tiles` is what kernels take; it is replaced when the tables grow, so it is asked for anew
    before every call. Pool and tables are reserved whole: memory that was not written to costs
    nothing, and only a long, narrow map ever moves its tables.
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
        self._room = GridStorage(min(max_cells, most), resolution, SIDE)
        self.tiles = Tiles(
            cells=zeros((max_tiles + 1, CELLS, depth), np.float32),
            tables=self._tables(n_particles, layers),
            references=np.zeros(max_tiles + 1, np.int32),
            free=np.concatenate([[max_tiles], np.arange(max_tiles, 0, -1)]).astype(np.int32),
            window=np.array((0, 0, -1, -1)),
            corner_x=self._room.x0 // SIDE,
            corner_y=self._room.y0 // SIDE,
            resolution=resolution,
        )

    @property
    def used(self) -> int:
        """Tiles in use now."""
        return len(self.tiles.references) - 1 - int(self.tiles.free[0])

    @property
    def counts(self) -> dict[str, Any]:
        """What the maps take, and where they might not grow, for a report."""
        tiles = {"particles": self.tiles.tables.shape[2], "tiles": self.used}
        return tiles | self.extent.counts

    def admits(self, pose: Pose2, far: float) -> bool:
        """Whether the maps may grow to what is at most `far` [m] away from `pose`."""
        return self.extent.admits(Box.around(pose.x, pose.y, far))

    def face(self, heading: float) -> None:
        """Tell layers apart by walls that face `heading` [rad] and its right angles."""
        self.tiles = self.tiles._replace(axis_x=math.cos(heading), axis_y=math.sin(heading))

    def cover(self, poses: Floats, far: float) -> None:
        """Let the tables reach `far` [m] around all poses (n, 3), if they may grow so far."""
        low, high = poses[:, :2].min(axis=0) - far, poses[:, :2].max(axis=0) + far
        if not self.extent.admits(Box(*low.tolist(), *high.tolist())):
            return
        edge, old = self.tiles.resolution, self.tiles.tables
        added = self._room.reach(Box(*(low - edge).tolist(), *(high + edge).tolist()))
        if added is None:
            return
        below, left = (cells // SIDE for cells in added)
        tables = self._tables(*old.shape[2:])
        move(old, tables, below, left)
        x, y = self.tiles.corner_x - left, self.tiles.corner_y - below
        self.tiles = self.tiles._replace(tables=tables, corner_x=x, corner_y=y)

    def _tables(self, n_particles: int, layers: int) -> NDArray[np.int32]:
        shape = self._room.height // SIDE, self._room.width // SIDE
        return zeros((*shape, n_particles, layers), np.int32)

    def inherit(self, ancestors: NDArray[np.int64]) -> None:
        """Hand every particle its ancestor's map, without copying tiles; ancestors keep theirs."""
        inherit(self.tiles, ancestors)
