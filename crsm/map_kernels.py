"""The global map: walls with sub-cell position, and grey levels for the reader."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import FAST, njit

HALO = 3  # cells that a wall darkens around itself in the search field
X, Y, NX, NY, WEIGHT = 0, 1, 2, 3, 4


class WallMap(NamedTuple):
    """Cells [iy, ix] of edge `cell` [m]; cell [0, 0] has its lower corner at corner (x, y) [m].

    wall (ny, nx, 5) float32: mean end point x, y [m], wall normal (0, 0 for a lone point), weight
    (0: nothing there). dark (ny, nx) uint8: nearness of a wall. grey (fine ny, fine nx) float32:
    1 wall .. 0 unknown .. -1 free, in `fine` times smaller cells; drawn, of the same shape, int32:
    the last drawing that touched a cell.
    """

    wall: NDArray[Any]
    dark: NDArray[Any]
    grey: NDArray[Any]
    drawn: NDArray[Any]
    corner: tuple[float, float]
    cell: float
    fine: int


@njit(fastmath=FAST, inner=True)  # 15 % of the fit
def nearest_wall(wall: Any, ix: int, iy: int, point: Any, gate: float, compat: float) -> Any:
    """ours: the wall element in and around cell (ix, iy) nearest to the point (x, y, nx, ny).

    gate [m] across the wall; compat: least cosine between the normals. Returns its (ix, iy),
    (0, 0) if there is none.
    """
    x, y, nx, ny = point
    lone = nx == 0.0 and ny == 0.0
    nearest = np.float32(1e9)
    found_x, found_y = 0, 0
    for jy in range(iy - 1, iy + 2):
        for jx in range(ix - 1, ix + 2):
            if wall[jy, jx, WEIGHT] <= 0.0:
                continue
            wx, wy = wall[jy, jx, NX], wall[jy, jx, NY]
            if not lone and wx * nx + wy * ny < compat:
                continue
            dx, dy = x - wall[jy, jx, X], y - wall[jy, jx, Y]
            d2 = dx * dx + dy * dy
            if d2 < nearest and abs(wx * dx + wy * dy) < gate:
                nearest = d2
                found_x, found_y = jx, jy
    return found_x, found_y


@njit
def whiten(grid: WallMap, start: Any, ends: Any, mark: int, share: float) -> None:
    """[Tsardoulias13] map update: the ways of beams get whiter, by less the whiter they are.

    ours: a cell changes once per drawing, `mark` is its number. start (x, y) and ends (2, k) are in
    grey cells from the corner; share: first step as a share of the way to white.
    """
    grey, drawn = grid.grey, grid.drawn
    for i in range(ends.shape[1]):
        dx, dy = ends[0, i] - start[0], ends[1, i] - start[1]
        length = math.sqrt(dx * dx + dy * dy)
        for j in range(math.floor(length) - 1):
            along = j / length
            ix, iy = math.floor(start[0] + along * dx), math.floor(start[1] + along * dy)
            if drawn[iy, ix] != mark:
                drawn[iy, ix] = mark
                g = grey[iy, ix]
                grey[iy, ix] = max(-1.0, g - share * (1.0 - math.sqrt(max(0.0, -g))))
