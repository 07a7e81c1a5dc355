"""The cells of two maps side by side: what is known of each, in one grid."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats, OccupancyGrid, Pose2

Mask = NDArray[np.bool_]


class Cells(NamedTuple):
    """What is known of the cells (ny, nx) of a grid."""

    occupied: Mask
    free: Mask

    @property
    def known(self) -> Mask:
        """Cells of which something is known."""
        return self.occupied | self.free


class Window(NamedTuple):
    """The part of a grid, or around it, from cell [iy, ix] on."""

    iy: int
    ix: int
    ny: int
    nx: int


def cells_of(p: NDArray[np.float32]) -> Cells:
    """Occupied above a probability of one half, free below; nan is unknown."""
    return Cells(p > 0.5, p < 0.5)


def centers(grid: OccupancyGrid, mask: Mask) -> Floats:
    """Centers (n, 2) [m] of the cells of a mask."""
    iy, ix = np.nonzero(mask)
    x, y = grid.origin
    return np.stack([x + (ix + 0.5) * grid.resolution, y + (iy + 0.5) * grid.resolution], axis=1)


def true_window(truth: OccupancyGrid, grid: OccupancyGrid, T_world_map: Pose2) -> Window:
    """The part of the run's grid that holds all that the true map knows; never empty."""
    known = T_world_map.inverse().transform(centers(truth, cells_of(truth.p).known))
    if not len(known):
        return Window(0, 0, 1, 1)
    margin, origin = truth.resolution, np.array(grid.origin)
    low = np.floor((known.min(axis=0) - margin - origin) / grid.resolution).astype(int)
    high = np.ceil((known.max(axis=0) + margin - origin) / grid.resolution).astype(int)
    return Window(int(low[1]), int(low[0]), int(high[1] - low[1]), int(high[0] - low[0]))


def cut(grid: OccupancyGrid, window: Window) -> Cells:
    """The run's own cells of a window, unknown beyond its edges."""
    p = np.full((window.ny, window.nx), np.nan, np.float32)
    ny, nx = grid.p.shape
    iy, ix = (
        np.arange(window.iy, window.iy + window.ny),
        np.arange(window.ix, window.ix + window.nx),
    )
    in_y, in_x = (iy >= 0) & (iy < ny), (ix >= 0) & (ix < nx)
    p[np.ix_(in_y, in_x)] = grid.p[np.ix_(iy[in_y], ix[in_x])]
    return cells_of(p)


def resampled(
    truth: OccupancyGrid, grid: OccupancyGrid, T_world_map: Pose2, window: Window
) -> Cells:
    """The true map in the run's grid, looked up at points half a true cell apart or closer."""
    true = cells_of(truth.p)
    ny, nx = truth.p.shape
    parts = max(1, math.ceil(2.0 * grid.resolution / truth.resolution))
    occupied = np.zeros((window.ny, window.nx), bool)
    free = np.zeros_like(occupied)
    c, s = math.cos(T_world_map.theta), math.sin(T_world_map.theta)
    for part in range(parts * parts):
        down, across = divmod(part, parts)
        ix = window.ix + np.arange(window.nx) + (across + 0.5) / parts
        iy = window.iy + np.arange(window.ny) + (down + 0.5) / parts
        x, y = ix * grid.resolution + grid.origin[0], iy[:, None] * grid.resolution + grid.origin[1]
        at_x = np.floor((T_world_map.x + c * x - s * y - truth.origin[0]) / truth.resolution)
        at_y = np.floor((T_world_map.y + s * x + c * y - truth.origin[1]) / truth.resolution)
        inside = (at_x >= 0) & (at_x < nx) & (at_y >= 0) & (at_y < ny)
        place = at_y[inside].astype(int), at_x[inside].astype(int)
        occupied[inside] |= true.occupied[place]
        free[inside] |= true.free[place]
    return Cells(occupied, free & ~occupied)
