"""Kernels of the grey map: beams whiten the cells on their way and blacken the walls at their ends.

Coordinates of a grid are real numbers in cells; the integer i is the CENTER of cell i, so that
cell = (world - first) / resolution with `first` the center of cell [0, 0].
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import FAST, njit
from slams.scan.scan_kernels import Points
from slams.types import Floats

EDGE = 2.5  # widths beyond which a stroke is not drawn
ALIKE = 0.9  # least cosine between the normals of end points of one stroke
X, Y, NX, NY, HALF = 0, 1, 2, 3, 4  # columns of a stroke


class Grid(NamedTuple):
    """Grey levels of square cells; arrays are indexed [iy, ix].

    `grey` (ny, nx) from 1, wall, over 0, unknown, to -1, free: the weighted mean of what scans
    observed; `weight` (ny, nx) of that mean; `stamp` (ny, nx) the last scan that touched a cell;
    x0, y0 [m] the center of cell [0, 0]; `resolution` [m].
    """

    grey: NDArray[np.float32]
    weight: NDArray[np.float32]
    stamp: NDArray[np.int32]
    x0: float
    y0: float
    resolution: float


class Update(NamedTuple):
    """Weight of a beam that passed a cell (a hit has 1); greatest weight of a cell.

    `width` of a stroke across its wall [m], its standard deviation; `unknown` the weight of an
    unknown cell, which beams that pass have to outweigh.
    """

    free: float
    most: float
    width: float
    unknown: float


@njit
def strokes(points: Points, normals: Points, n: int, length: float, out: Floats) -> int:
    """Neighboring end points with like normals, not more than `length` [m] apart, as one stroke.

    ours: a wall near the laser is drawn once a cell, not once a beam. points, normals (3, >= n) in
    the base frame; out (>= n, 5): middle [m], unit normal (0, 0 of a lone point), half length [m]
    with half of the gap to the next beam. Returns how many.
    """
    count, i = 0, 0
    while i < n:
        x, y, nx, ny, gap = points[0, i], points[1, i], normals[0, i], normals[1, i], normals[2, i]
        first, total_x, total_y = i, x, y
        while i + 1 < n and (nx != 0.0 or ny != 0.0):
            dx, dy = points[0, i + 1] - x, points[1, i + 1] - y
            alike = nx * normals[0, i + 1] + ny * normals[1, i + 1]
            if dx * dx + dy * dy > length * length or alike < ALIKE:
                break
            i += 1
            total_x, total_y = total_x + points[0, i], total_y + points[1, i]
        dx, dy = points[0, i] - x, points[1, i] - y
        k = i + 1 - first
        out[count, X], out[count, Y] = total_x / k, total_y / k
        out[count, NX], out[count, NY] = nx, ny
        out[count, HALF] = 0.5 * (math.sqrt(dx * dx + dy * dy) + gap)
        count += 1
        i += 1
    return count


@njit(inner=True, borrows=True)
def observe(
    grid: Grid, u: np.uint64, v: np.uint64, value: float, weight: float, most: float
) -> None:
    """Weighted mean of what was observed of cell [v, u], of at most so much weight.

    [Tsardoulias13] map update: the surer a cell is, the smaller its steps; ours: as a mean.
    """
    total = grid.weight[v, u] + weight
    grid.grey[v, u] += (value - grid.grey[v, u]) * weight / total
    grid.weight[v, u] = min(total, most)


@njit
def blacken(grid: Grid, ends: Floats, count: int, pose: Any, mark: int, update: Any) -> None:
    """[Tsardoulias13] map update: the ends of beams get black; ours: with their sub-cell position.

    A stroke along the wall, as dark as a Gaussian of the distance across it. Each cell counts it by
    that darkness, too: so a stroke says nothing of the other face of a thin wall, or of the next
    wall at a corner. ends (>= count, 5) of `strokes`; pose x, y, theta; `Update` as a plain tuple.
    """
    x0, y0, theta = pose
    _, most, width, _ = update
    height, wide = grid.grey.shape
    scale = 1.0 / grid.resolution
    c, s = math.cos(theta), math.sin(theta)
    sigma = width * scale
    fall = 0.5 / (sigma * sigma)
    for i in range(count):
        px, py = ends[i, X], ends[i, Y]
        u = (c * px - s * py + x0 - grid.x0) * scale
        v = (s * px + c * py + y0 - grid.y0) * scale
        nx, ny = c * ends[i, NX] - s * ends[i, NY], s * ends[i, NX] + c * ends[i, NY]
        lone = nx == 0.0 and ny == 0.0
        half = EDGE * sigma if lone else ends[i, HALF] * scale + 0.5
        across = EDGE * sigma
        reach_x = half if lone else across * abs(nx) + half * abs(ny)
        reach_y = half if lone else across * abs(ny) + half * abs(nx)
        low_x, high_x = max(math.ceil(u - reach_x), 0), min(math.floor(u + reach_x), wide - 1)
        low_y, high_y = max(math.ceil(v - reach_y), 0), min(math.floor(v + reach_y), height - 1)
        for iy in range(low_y, high_y + 1):
            dy = iy - v
            for ix in range(low_x, high_x + 1):
                dx = ix - u
                off, along = dx * nx + dy * ny, dy * nx - dx * ny
                square = dx * dx + dy * dy if lone else off * off
                if abs(along) > half or square > across * across:
                    continue
                dark = math.exp(-fall * square)
                grid.stamp[iy, ix] = mark
                observe(grid, np.uint64(ix), np.uint64(iy), dark, dark, most)


@njit
def whiten(
    grid: Grid, ends: Floats, count: int, pose: Any, mount: Any, mark: int, update: Any
) -> None:
    """[Tsardoulias13] map update: the ways of beams get whiter, by less the whiter they are.

    ours: a cell changes once per scan, `mark` is its number, and not where a wall of the same scan
    was drawn; where nothing was known one scan alone makes nothing free, it may have passed above
    what stands there. Arguments as of `blacken`; mount x, y, theta of the laser.
    """
    x0, y0, theta = pose
    mx, my, _ = mount
    free, most, _, unknown = update
    scale = 1.0 / grid.resolution
    c, s = math.cos(theta), math.sin(theta)
    ax = (c * mx - s * my + x0 - grid.x0) * scale + 0.5
    ay = (s * mx + c * my + y0 - grid.y0) * scale + 0.5
    for i in range(count):
        px, py = ends[i, X], ends[i, Y]
        dx = (c * px - s * py + x0 - grid.x0) * scale + 0.5 - ax
        dy = (s * px + c * py + y0 - grid.y0) * scale + 0.5 - ay
        length = math.sqrt(dx * dx + dy * dy)
        steps = math.floor(length) - 1
        if steps < 1:
            continue
        dx, dy = dx / length, dy / length
        for j in range(steps):
            u, v = np.uint64(ax + j * dx), np.uint64(ay + j * dy)
            if grid.stamp[v, u] != mark:
                grid.stamp[v, u] = mark
                grid.weight[v, u] = max(grid.weight[v, u], unknown)
                observe(grid, u, v, -1.0, free, most)


@njit(fastmath=FAST, inner=True, borrows=True)
def darkness(grid: Grid, x: float, y: float) -> float:
    """How black the map is at (x, y) [cells]: 0 unknown or free, 1 on a wall, smooth. ours.

    Quadratic splines over the 3 x 3 cells around it.
    """
    height, width = grid.grey.shape
    u, v = x + 0.5, y + 0.5
    if not (u >= 1.0 and v >= 1.0 and u < width - 1 and v < height - 1):
        return 0.0
    ix, iy = np.uint64(u), np.uint64(v)
    s, t = u - ix, v - iy
    s1, t1 = 1.0 - s, 1.0 - t
    a, b, c = 0.5 * (s1 * s1), 0.5 + s - s * s, 0.5 * s * s
    total = 0.0
    one = np.uint64(1)
    for j in range(3):
        row = 0.5 * (t1 * t1) if j == 0 else (0.5 + t - t * t if j == 1 else 0.5 * t * t)
        i = iy - one + np.uint64(j)
        left, middle = max(grid.grey[i, ix - one], 0.0), max(grid.grey[i, ix], 0.0)
        total += row * (a * left + b * middle + c * max(grid.grey[i, ix + one], 0.0))
    return total
