"""Part of an algorithm's map, made ready for global localization in pieces of bounded work."""

from __future__ import annotations

import math

import numpy as np

from slams.localize.places import TURNS, Disc, Places
from slams.localize.search import Atlas
from slams.types import OccupancyGrid

MAX_CELLS = 700_000  # of one distance transform, 9 ms at 13 ns a cell; finer maps are coarsened
MAX_POINTS = 8_000  # of the view lattice: 0.25 m apart in up to 500 m^2 of free space, else wider
RAYS = 45_000  # cast into the map for one scan: 9 ms at 0.2 us


class MapPart:
    """Part of the map, made ready for a search in pieces.

    Args:
        grid: the part, from which walls are taken.
        area: where the robot is searched for.

    Raises:
        ValueError: by `prepare`, a part without walls or free space.
    """

    def __init__(self, grid: OccupancyGrid, area: Disc) -> None:
        self._grid, self._area = grid, area
        self._maps = ["gap", "cells", "clearance"]  # distance maps of a chart, one transform each
        self._atlas: Atlas | None = None
        self._lattice: Places | None = None

    def prepare(self, share: float) -> float:
        """Do the next piece, if it is at most `share` of a scan's work; returns the share done."""
        if self._lattice is not None:
            count = int(share * RAYS) // TURNS
            self._lattice.prepare(count)
            return count * TURNS / RAYS
        price = min(self._grid.p.size / MAX_CELLS, 1.0)
        if price > share:
            return 0.0
        if self._atlas is None:
            self._grid = coarsened(self._grid)
            self._atlas = Atlas(self._grid)
        elif self._maps:
            getattr(self._atlas.chart, self._maps.pop(0))
        else:
            self._lattice = self._atlas.places = Places(self._atlas.chart, MAX_POINTS, self._area)
        return price

    @property
    def ready(self) -> Atlas | None:
        """What can be searched; None as long as pieces are missing."""
        lattice = self._lattice
        return self._atlas if lattice is not None and lattice.ready == len(lattice) else None


def coarsened(grid: OccupancyGrid) -> OccupancyGrid:
    """A grid of at most `MAX_CELLS`: of every block of cells the largest known probability.

    Rows and columns beyond the last whole block are left out.
    """
    side = math.ceil(math.sqrt(grid.p.size / MAX_CELLS))
    if side <= 1:
        return grid
    ny, nx = grid.p.shape[0] // side, grid.p.shape[1] // side
    blocks = grid.p[: ny * side, : nx * side].reshape(ny, side, nx, side)
    p = np.fmax.reduce(np.fmax.reduce(blocks, axis=3), axis=1)
    return OccupancyGrid(p, grid.resolution * side, grid.origin)
