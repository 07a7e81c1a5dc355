"""TileMap: the maps of all particles in one pool of reference-counted tiles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from gmapping.tile_kernels import TILE_CELLS, TILE_SIDE, Tiles, inherit
from slams.cells import GridStorage, move, zeros
from slams.grid_bounds import DEFAULT_MAX_CELLS, Box, GridBounds
from slams.types import Floats, Pose2

MAX_TABLE_ENTRIES = 1 << 28  # of all tables together: 1 GB


class TileMap:
    """One map per particle; equal parts are stored once until one particle writes to them.

    `tiles` is the argument of kernels; growing tables replaces it, so a caller reads it before each
    call. Pool and tables are reserved at full size: unused memory costs nothing, and only a long,
    narrow map ever moves its tables. A cell has `n_values` numbers.
    """

    def __init__(
        self,
        n_particles: int,
        layers: int,
        resolution: float,
        max_tiles: int,
        max_cells: int = DEFAULT_MAX_CELLS,
        n_values: int = 4,
    ) -> None:
        max_cells = min(max_cells, MAX_TABLE_ENTRIES * TILE_CELLS // (n_particles * layers))
        self.bounds = GridBounds(max_cells, resolution)
        self._storage = GridStorage(max_cells, resolution, TILE_SIDE)
        self.tiles = Tiles(
            cells=zeros((max_tiles + 1, TILE_CELLS, n_values), np.float32),
            tables=self._table(np.int32, n_particles, layers),
            references=np.zeros(max_tiles + 1, np.int32),
            free=np.concatenate([[max_tiles], np.arange(max_tiles, 0, -1)]).astype(np.int32),
            written=self._table(np.bool_),
            corner_x=self._storage.x0 // TILE_SIDE,
            corner_y=self._storage.y0 // TILE_SIDE,
            resolution=resolution,
        )

    @property
    def used(self) -> int:
        """Number of tiles in use."""
        return len(self.tiles.references) - 1 - int(self.tiles.free[0])

    @property
    def counts(self) -> dict[str, Any]:
        """Size of the maps, and counts of scans beyond their bounds, for a report."""
        tiles = {"particles": self.tiles.tables.shape[2], "tiles": self.used}
        return tiles | self.bounds.counts

    def admits(self, pose: Pose2, radius: float) -> bool:
        """Whether the maps may grow to all points within `radius` [m] of `pose`."""
        return self.bounds.admits(Box.around(pose.x, pose.y, radius))

    def set_axis(self, heading: float) -> None:
        """Separate the layers by normals near `heading` [rad] and its right angles."""
        self.tiles = self.tiles._replace(axis_x=math.cos(heading), axis_y=math.sin(heading))

    def cover(self, poses: Floats, radius: float) -> None:
        """Extend the tables by `radius` [m] around all poses (n, 3), within the bounds."""
        low, high = poses[:, :2].min(axis=0) - radius, poses[:, :2].max(axis=0) + radius
        if not self.bounds.admits(Box(*low.tolist(), *high.tolist())):
            return
        old = self.tiles
        margin = TILE_SIDE * old.resolution  # a point is written to cells around it
        added = self._storage.reach(Box(*(low - margin).tolist(), *(high + margin).tolist()))
        if added is None:
            return
        below, left = (cells // TILE_SIDE for cells in added)
        tables, written = self._table(np.int32, *old.tables.shape[2:]), self._table(np.bool_)
        move(old.tables, tables, below, left)
        move(old.written, written, below, left)
        x, y = old.corner_x - left, old.corner_y - below
        self.tiles = old._replace(tables=tables, written=written, corner_x=x, corner_y=y)

    def _table(self, dtype: DTypeLike, *entries: int) -> NDArray[Any]:
        shape = self._storage.height // TILE_SIDE, self._storage.width // TILE_SIDE
        return zeros((*shape, *entries), dtype)

    def inherit(self, ancestors: NDArray[np.int64]) -> None:
        """Give every particle its ancestor's map without copying tiles; survivors keep theirs."""
        inherit(self.tiles, ancestors)
