"""The global map: walls with sub-cell position, and grey levels for the reader."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numpy.typing import NDArray

from slams.cells import deepcopied
from slams.jit import FAST, njit
from slams.scan.scan_kernels import Points
from slams.types import Pose2

BLUR = 1.0  # dark cells, sigma of a blot: the least that is smooth between their middles
ROUND = 0.5  # map cells: a blot that is so long has 1 in its middle, a longer one less
EDGE = 3.0  # sigma, beyond which a blot is not drawn
FULL = 1.1  # sum of the blots on a straight wall that has an element in every cell
HALF = 2.0  # of FULL, where half of the greatest darkness is reached
MOVED, TURNED = 1e-3, 0.02  # m, rad that an element may go and turn before its blot follows
X, Y, NX, NY, WEIGHT = 0, 1, 2, 3, 4
WIDTH = 4  # of a blot


class Joining(NamedTuple):
    """Which points an element averages over.

    near [m] it and compat, least cosine between the normals; most of them, then it follows slowly.
    """

    near: float
    compat: float
    most: float


class WallMap(NamedTuple):
    """Cells [iy, ix] of edge `cell` [m]; cell [0, 0] has its lower corner at corner (x, y) [m].

    wall (ny, nx, 5) float32: mean end point x, y [m], wall normal (0, 0 for a lone point), weight
    (0: nothing there). blot (ny, nx, 5) float32: the wall element as its blot stands in `dark`,
    x, y, normal, and its width across the wall (sigma in dark cells, 0: it has none). In `sharp`
    times smaller cells, (sharp ny, sharp nx) float32: dark, the sum of all blots. In `fine` times
    smaller cells: grey, float32, 1 wall .. 0 unknown .. -1 free; drawn, int32: the last drawing
    that touched a cell. stroke: sigma of a blot along its wall in map cells.
    """

    wall: NDArray[Any]
    blot: NDArray[Any]
    dark: NDArray[Any]
    grey: NDArray[Any]
    drawn: NDArray[Any]
    corner: tuple[float, float]
    cell: float
    fine: int
    sharp: int
    stroke: float

    def __deepcopy__(self, memo: dict[int, Any]) -> WallMap:
        return WallMap(*deepcopied(self, memo))


@njit(inner=True)
def add_blot(grid: WallMap, at: Any, width: float, sign: float) -> None:
    """ours: add (or take away) the blot of the wall element at (x, y, nx, ny) to the dark field.

    A Gaussian of `width` (sigma in dark cells), along the wall of the map's `stroke`; a round one
    of a lone point. Straight walls are as dark whatever the stroke.
    """
    step, dark = grid.cell / grid.sharp, grid.dark
    x0, y0 = grid.corner
    u, v = (at[X] - x0) / step, (at[Y] - y0) / step
    nx, ny = at[NX], at[NY]
    length = width
    if nx == 0.0 and ny == 0.0:
        nx = 1.0
    else:
        length = max(grid.stroke * grid.sharp, width)
    ink = sign * ROUND / grid.stroke
    reach_x = math.ceil(EDGE * math.hypot(width * nx, length * ny))
    reach_y = math.ceil(EDGE * math.hypot(width * ny, length * nx))
    across, along = 0.5 / (width * width), 0.5 / (length * length)
    ix, iy = math.floor(u), math.floor(v)
    for jy in range(max(iy - reach_y, 0), min(iy + reach_y + 1, dark.shape[0])):
        dy = jy + 0.5 - v
        for jx in range(max(ix - reach_x, 0), min(ix + reach_x + 1, dark.shape[1])):
            dx = jx + 0.5 - u
            off, by = dx * nx + dy * ny, dy * nx - dx * ny
            square = across * off * off + along * by * by
            if square < 0.5 * EDGE * EDGE:
                dark[jy, jx] += ink * math.exp(-square)


@njit
def redraw(grid: WallMap, cells: Any, width: float) -> None:
    """ours: let the blots of the wall elements in these cells, (k,) along the rows, follow them.

    Those that are drawn anew are of this width (sigma in dark cells).
    """
    nx = grid.wall.shape[1]
    for k in range(cells.shape[0]):
        iy, ix = cells[k] // nx, cells[k] % nx
        wall, blot = grid.wall[iy, ix], grid.blot[iy, ix]
        is_wall, is_drawn = wall[WEIGHT] > 0.0, blot[WIDTH] > 0.0
        dx, dy = wall[X] - blot[X], wall[Y] - blot[Y]
        turn = math.hypot(wall[NX] - blot[NX], wall[NY] - blot[NY])
        if is_wall and is_drawn and dx * dx + dy * dy < MOVED * MOVED and turn < TURNED:
            continue
        if is_drawn:
            add_blot(grid, blot, blot[WIDTH], -1.0)
            blot[WIDTH] = 0.0
        if is_wall:
            for i in range(WIDTH):
                blot[i] = wall[i]
            blot[WIDTH] = width
            add_blot(grid, blot, blot[WIDTH], 1.0)


@njit(fastmath=FAST, inner=True)
def darkness(grid: WallMap, x: float, y: float) -> float:
    """ours: how dark the map is at (x, y) [m]: 0 nothing, about 1 on a wall, smooth.

    Quadratic splines over the 3 x 3 dark cells around it; blots upon each other count less.
    """
    step, dark = grid.cell / grid.sharp, grid.dark
    x0, y0 = grid.corner
    u, v = (x - x0) / step, (y - y0) / step
    ix, iy = math.floor(u), math.floor(v)
    if min(ix, iy) < 1 or ix >= dark.shape[1] - 1 or iy >= dark.shape[0] - 1:
        return 0.0
    s, t = u - ix, v - iy
    s1, t1 = 1.0 - s, 1.0 - t
    a, b, c = 0.5 * (s1 * s1), 0.5 + s - s * s, 0.5 * s * s
    total = 0.0
    for j in range(3):
        row = 0.5 * (t1 * t1) if j == 0 else (0.5 + t - t * t if j == 1 else 0.5 * t * t)
        i = iy - 1 + j
        total += row * (a * dark[i, ix - 1] + b * dark[i, ix] + c * dark[i, ix + 1])
    return (1.0 + HALF) * total / (HALF * FULL + total)


@njit(inner=True)
def wall_of(wall: Any, ix: int, iy: int, point: Any, rule: Joining) -> Any:
    """ours: cell (ix, iy) of the element that the point (x, y, nx, ny) seen in this cell is of.

    The nearest around of its kind, if that is near enough; else the cell itself.
    """
    x, y, nx, ny = point
    lone = nx == 0.0 and ny == 0.0
    nearest = rule.near * rule.near
    found_x, found_y = ix, iy
    for jy in range(iy - 1, iy + 2):
        for jx in range(ix - 1, ix + 2):
            wx, wy = wall[jy, jx, NX], wall[jy, jx, NY]
            alike = wx * nx + wy * ny > rule.compat or (lone and wx == 0.0 and wy == 0.0)
            dx, dy = x - wall[jy, jx, X], y - wall[jy, jx, Y]
            d2 = dx * dx + dy * dy
            if wall[jy, jx, WEIGHT] > 0.0 and alike and d2 < nearest:
                nearest = d2
                found_x, found_y = jx, jy
    return found_x, found_y


@njit(inner=True)
def joins(element: Any, point: Any, rule: Joining) -> bool:
    """ours: whether a point is of an element's kind and near; it may begin an empty one.

    A wall takes the place of a lone point.
    """
    x, y, nx, ny = point
    wx, wy, lone = element[NX], element[NY], nx == 0.0 and ny == 0.0
    if element[WEIGHT] <= 0.0 or (wx == 0.0 and wy == 0.0 and not lone):
        element[X], element[Y], element[NX], element[NY], element[WEIGHT] = x, y, nx, ny, 0.0
        return True
    dx, dy = x - element[X], y - element[Y]
    alike = wx * nx + wy * ny > rule.compat or (lone and wx == 0.0 and wy == 0.0)
    near: bool = dx * dx + dy * dy < rule.near * rule.near
    return alike and near


@njit
def add_points(
    grid: WallMap, points: Points, normals: Points, m: int, pose: Pose2, rule: Joining, out: Any
) -> int:
    """ours: running means of wall elements with the m points of a scan; how many there are of.

    points, normals (3, >= m) in the base frame; out (>= m,): numbers of the cells, counted along
    the rows, some more than once.
    """
    wall, (x0, y0), cell = grid.wall, grid.corner, grid.cell
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    count = 0
    for i in range(m):
        x, y = (
            pose.x + c * points[0, i] - s * points[1, i],
            pose.y + s * points[0, i] + c * points[1, i],
        )
        nx, ny = c * normals[0, i] - s * normals[1, i], s * normals[0, i] + c * normals[1, i]
        point = (x, y, nx, ny)
        ix, iy = wall_of(
            wall, math.floor((x - x0) / cell), math.floor((y - y0) / cell), point, rule
        )
        element = wall[iy, ix]
        if not joins(element, point, rule):
            continue
        weight = min(element[WEIGHT] + 1.0, rule.most)
        for k in range(4):
            element[k] += (point[k] - element[k]) / weight
        length = math.sqrt(element[NX] * element[NX] + element[NY] * element[NY])
        if length > 0.0:
            element[NX] /= length
            element[NY] /= length
        element[WEIGHT] = weight
        out[count] = iy * wall.shape[1] + ix
        count += 1
    return count


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
