"""The global map: walls with sub-cell position, and grey levels for the reader."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numpy.typing import NDArray

from crsm.scan_kernels import Points
from slams.jit import FAST, njit

HALO = 3  # cells that a wall darkens around itself in the search field
X, Y, NX, NY, WEIGHT = 0, 1, 2, 3, 4
ONE_CELL = 0.6  # cells between an end point and the wall element it joins
MARGIN = 2.0  # cells that a beam goes on behind a wall to have gone through it
CORE = 0.25  # cells around the mean end point of an element that is surely wall


class WallMap(NamedTuple):
    """Cells [iy, ix] of edge `cell` [m]; cell [0, 0] has its lower corner at corner (x, y) [m].

    wall (ny, nx, 5) float32: mean end point x, y [m], wall normal (0, 0 for a lone point), weight
    (0: nothing there). dark (ny, nx) uint8: nearness of a wall. grey (fine ny, fine nx) float32:
    1 wall .. 0 unknown .. -1 free, in `fine` times smaller cells; drawn, of the same shape, int32:
    the last drawing that touched a cell, times 2, plus 1 where a beam ended.
    """

    wall: NDArray[Any]
    dark: NDArray[Any]
    grey: NDArray[Any]
    drawn: NDArray[Any]
    corner: tuple[float, float]
    cell: float
    fine: int


@njit(fastmath=FAST)  # 15 % of the fit
def nearest_wall(wall: Any, ix: int, iy: int, point: Any, gate: float, compat: float) -> Any:
    """ours: the wall element in and around cell (ix, iy) nearest to the point (x, y, nx, ny).

    gate [m] across the wall; compat: least cosine between the normals. Returns (ix, iy, squared
    distance), ix = -1 if there is none.
    """
    x, y, nx, ny = point
    lone = nx == 0.0 and ny == 0.0
    nearest = 1e9
    found_x, found_y = -1, -1
    for jy in range(iy - 1, iy + 2):
        for jx in range(ix - 1, ix + 2):
            element = wall[jy, jx]
            if element[WEIGHT] <= 0.0:
                continue
            wx, wy = element[NX], element[NY]
            if not lone and wx * nx + wy * ny < compat:
                continue
            dx, dy = x - element[X], y - element[Y]
            d2 = dx * dx + dy * dy
            if d2 < nearest and abs(wx * dx + wy * dy) < gate:
                nearest = d2
                found_x, found_y = jx, jy
    return found_x, found_y, nearest


@njit
def average_in(element: Any, point: Any, max_weight: float) -> None:
    """ours: running mean of a wall element (5,) with a point (x, y, nx, ny)."""
    n = min(element[WEIGHT] + 1.0, max_weight)
    element[WEIGHT] = n
    for k in range(4):
        element[k] += (point[k] - element[k]) / n
    norm = math.sqrt(element[NX] ** 2 + element[NY] ** 2)
    if norm > 0.0:
        element[NX] /= norm
        element[NY] /= norm


@njit
def insert(grid: WallMap, points: Points, m: int, pose: Any, rules: Any, out_new: Any) -> int:
    """ours: every end point joins the wall element it lies on or starts one in its cell.

    A wall may take the place of a lone point, nothing takes the place of a wall. pose (x, y, theta)
    of the laser; rules (gate [m], least cosine, greatest weight); out_new (n, 2) cells (ix, iy) of
    the new elements, whose number is returned.
    """
    xy, normal = points.xy, points.normal
    wall, cell = grid.wall, grid.cell
    reach2 = (ONE_CELL * cell) ** 2
    c, s = math.cos(pose[2]), math.sin(pose[2])
    ny_cells, nx_cells = grid.dark.shape
    new = 0
    for i in range(m):
        px, py = xy[i, 0], xy[i, 1]
        nx, ny = normal[i, 0], normal[i, 1]
        x, y = c * px - s * py + pose[0], s * px + c * py + pose[1]
        ix = math.floor((x - grid.corner[0]) / cell)
        iy = math.floor((y - grid.corner[1]) / cell)
        if ix < HALO or iy < HALO or ix >= nx_cells - HALO or iy >= ny_cells - HALO:
            continue
        lone = nx == 0.0 and ny == 0.0
        point = (x, y, c * nx - s * ny, s * nx + c * ny)
        jx, jy, d2 = nearest_wall(wall, ix, iy, point, rules[0], rules[1])
        if jx >= 0 and d2 < reach2 and lone == is_lone(wall[jy, jx]):
            average_in(wall[jy, jx], point, rules[2])
            continue
        element = wall[iy, ix]
        if element[WEIGHT] <= 0.0 or (is_lone(element) and not lone):
            element[WEIGHT] = 0.0
            average_in(element, point, rules[2])
            out_new[new, 0], out_new[new, 1] = ix, iy
            new += 1
    return new


@njit
def is_lone(element: Any) -> bool:
    """ours: a wall element (5,) without a normal is a lone point."""
    return bool(element[NX] == 0.0 and element[NY] == 0.0)


@njit
def shaded(grey: float, step: float) -> float:
    """[Tsardoulias13] table of the map update: a step to black (+) or white (-), shrinking.

    ours: a step back towards unknown does not shrink, so nothing is for ever.
    """
    if grey * step > 0.0:
        step *= 1.0 - math.sqrt(abs(grey))
    return min(1.0, max(-1.0, grey + step))


@njit
def went_through(element: Any, x: float, y: float, ray: Any, cell: float) -> bool:
    """ours: a beam from (x, y) [m] passed the core of a wall element (5,) and went on behind it.

    ray (unit vector x, y, length [m]). A beam along the wall, or one that ends at it, did not.
    """
    dx, dy = element[X] - x, element[Y] - y
    behind = ray[2] - dx * ray[0] - dy * ray[1]
    if not is_lone(element):
        behind *= abs(element[NX] * ray[0] + element[NY] * ray[1])
    return bool(behind > MARGIN * cell and abs(dx * ray[1] - dy * ray[0]) < CORE * cell)


@njit
def draw(grid: WallMap, points: Points, m: int, pose: Any, rules: Any, out_passed: Any) -> int:
    """[Tsardoulias13] map update: the way of a beam gets whiter, its end blacker.

    ours: a cell changes once per drawing. rules (number of the drawing, step to white, to black);
    out_passed (n, 2): cells (ix, iy) of wall elements that beams went through, some of them more
    than once; their number is returned.
    """
    xy, grey, drawn, wall = points.xy, grid.grey, grid.drawn, grid.wall
    step, mark = grid.cell / grid.fine, 2 * rules[0]
    c, s = math.cos(pose[2]), math.sin(pose[2])
    from_x, from_y = (pose[0] - grid.corner[0]) / step, (pose[1] - grid.corner[1]) / step
    last_x, last_y, passed = -1, -1, 0
    for i in range(m):
        dx, dy = c * xy[i, 0] - s * xy[i, 1], s * xy[i, 0] + c * xy[i, 1]
        end_x, end_y = math.floor(from_x + dx / step), math.floor(from_y + dy / step)
        if end_x == last_x and end_y == last_y:
            continue
        last_x, last_y = end_x, end_y
        length = max(math.sqrt(dx * dx + dy * dy), 1e-9)
        ray = (dx / length, dy / length, length)
        for j in range(math.floor(length / step) - 1):
            ix, iy = math.floor(from_x + j * ray[0]), math.floor(from_y + j * ray[1])
            if drawn[iy, ix] < mark:
                drawn[iy, ix] = mark
                grey[iy, ix] = shaded(grey[iy, ix], rules[1])
            jx, jy = ix // grid.fine, iy // grid.fine
            if wall[jy, jx, WEIGHT] <= 0.0 or passed == out_passed.shape[0]:
                continue
            if went_through(wall[jy, jx], pose[0], pose[1], ray, grid.cell):
                out_passed[passed, 0], out_passed[passed, 1] = jx, jy
                passed += 1
        if drawn[end_y, end_x] <= mark:
            drawn[end_y, end_x] = mark + 1
            grey[end_y, end_x] = shaded(grey[end_y, end_x], rules[2])
    return passed
