"""Kernels of the gray map: end points make cells darker, the free space before them lighter.

Coordinates of a grid are real numbers in cells, and the integer i is the CENTER of cell i:
cell = (world - first) / resolution, with `first` the center of cell [0, 0].
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import FAST, njit
from slams.scan.scan_kernels import Points
from slams.types import Floats

KERNEL_RADIUS = 2.5  # standard deviations; beyond, the Gaussian kernel of a wall is cut off
MIN_SEGMENT_COSINE = 0.9  # 1; between the normals of end points of one segment
X, Y, NX, NY, HALF_LENGTH = 0, 1, 2, 3, 4  # columns of a segment


class Grid(NamedTuple):
    """Gray levels of square cells; arrays (ny, nx) are indexed [iy, ix].

    `gray` is the weighted mean of the observations of a cell: 1 wall, 0 unknown, -1 free; `weight`
    the weight of this mean; `stamp` the number of the last scan that changed a cell; x0, y0 [m] the
    center of cell [0, 0]; `resolution` the edge of a cell [m].
    """

    gray: NDArray[np.float32]
    weight: NDArray[np.float32]
    stamp: NDArray[np.int32]
    x0: float
    y0: float
    resolution: float


class Update(NamedTuple):
    """How a scan enters a grid.

    `free` is the weight of a beam that passes a cell (a hit has 1); `max_weight` limits a cell's;
    `width` [m] is the standard deviation of a wall's kernel; `unknown_weight` the weight of a cell
    without observations.
    """

    free: float
    max_weight: float
    width: float
    unknown_weight: float


@njit
def wall_segments(points: Points, normals: Points, n: int, length: float, out: Floats) -> int:
    """Join neighboring end points with like normals to segments up to `length` [m].

    ours: a wall near the laser enters the map once per cell, not once per beam. points, normals
    (3, >= n) in the base frame; out (>= n, 5): center [m], unit normal (0, 0 for an isolated
    point), half length [m] with half of the gap to the next beam. Returns the number of segments.
    """
    count, i = 0, 0
    while i < n:
        x, y, nx, ny, gap = points[0, i], points[1, i], normals[0, i], normals[1, i], normals[2, i]
        first, total_x, total_y = i, x, y
        while i + 1 < n and (nx != 0.0 or ny != 0.0):
            dx, dy = points[0, i + 1] - x, points[1, i + 1] - y
            cosine = nx * normals[0, i + 1] + ny * normals[1, i + 1]
            if dx * dx + dy * dy > length * length or cosine < MIN_SEGMENT_COSINE:
                break
            i += 1
            total_x, total_y = total_x + points[0, i], total_y + points[1, i]
        dx, dy = points[0, i] - x, points[1, i] - y
        k = i + 1 - first
        out[count, X], out[count, Y] = total_x / k, total_y / k
        out[count, NX], out[count, NY] = nx, ny
        out[count, HALF_LENGTH] = 0.5 * (math.sqrt(dx * dx + dy * dy) + gap)
        count += 1
        i += 1
    return count


@njit(inner=True, borrows=True)
def observe(
    grid: Grid, u: np.uint64, v: np.uint64, value: float, weight: float, max_weight: float
) -> None:
    """Add an observation to the weighted mean of cell [v, u].

    [Tsardoulias13] map update: steps get smaller towards black and white; ours: with the weight.
    """
    total = grid.weight[v, u] + weight
    grid.gray[v, u] += (value - grid.gray[v, u]) * weight / total
    grid.weight[v, u] = min(total, max_weight)


@njit
def add_walls(grid: Grid, segments: Floats, n: int, pose: Any, number: int, update: Any) -> None:
    """Make the cells at end points darker: [Tsardoulias13] map update; ours: sub-cell position.

    The darkness of a segment's kernel is a Gaussian of the distance across the wall. It is also the
    weight of the observation, so that the kernel hardly changes the other face of a thin wall, or
    the next wall at a corner. segments (>= n, 5) of `wall_segments`; pose x, y, theta; `number` of
    the scan; `Update` as a plain tuple.
    """
    x0, y0, theta = pose
    _, max_weight, width, _ = update
    rows, columns = grid.gray.shape
    scale = 1.0 / grid.resolution
    c, s = math.cos(theta), math.sin(theta)
    sigma = width * scale
    exponent = 0.5 / (sigma * sigma)
    for i in range(n):
        px, py, mx, my = segments[i, X], segments[i, Y], segments[i, NX], segments[i, NY]
        u = (c * px - s * py + x0 - grid.x0) * scale
        v = (s * px + c * py + y0 - grid.y0) * scale
        nx, ny = c * mx - s * my, s * mx + c * my
        isolated = nx == 0.0 and ny == 0.0
        half = KERNEL_RADIUS * sigma if isolated else segments[i, HALF_LENGTH] * scale + 0.5
        across = KERNEL_RADIUS * sigma
        reach_x = half if isolated else across * abs(nx) + half * abs(ny)
        reach_y = half if isolated else across * abs(ny) + half * abs(nx)
        low_x, high_x = max(math.ceil(u - reach_x), 0), min(math.floor(u + reach_x), columns - 1)
        low_y, high_y = max(math.ceil(v - reach_y), 0), min(math.floor(v + reach_y), rows - 1)
        for iy in range(low_y, high_y + 1):
            dy = iy - v
            for ix in range(low_x, high_x + 1):
                dx = ix - u
                distance, along = dx * nx + dy * ny, dy * nx - dx * ny
                square = dx * dx + dy * dy if isolated else distance * distance
                if abs(along) > half or square > across * across:
                    continue
                dark = math.exp(-exponent * square)
                grid.stamp[iy, ix] = number
                observe(grid, np.uint64(ix), np.uint64(iy), dark, dark, max_weight)


@njit
def add_free_space(
    grid: Grid, segments: Floats, n: int, pose: Any, mount: Any, number: int, update: Any
) -> None:
    """Make the cells that beams pass lighter: [Tsardoulias13] map update.

    ours: a cell changes once per scan, and not at all where the same scan has added a wall. The
    weight of an unknown cell keeps one scan from making it free: a beam may have passed above an
    obstacle. Arguments are those of `add_walls`; mount x, y, theta of the laser.
    """
    x0, y0, theta = pose
    mx, my, _ = mount
    free, max_weight, _, unknown_weight = update
    scale = 1.0 / grid.resolution
    c, s = math.cos(theta), math.sin(theta)
    ax = (c * mx - s * my + x0 - grid.x0) * scale + 0.5
    ay = (s * mx + c * my + y0 - grid.y0) * scale + 0.5
    for i in range(n):
        px, py = segments[i, X], segments[i, Y]
        dx = (c * px - s * py + x0 - grid.x0) * scale + 0.5 - ax
        dy = (s * px + c * py + y0 - grid.y0) * scale + 0.5 - ay
        length = math.sqrt(dx * dx + dy * dy)
        steps = math.floor(length) - 1
        if steps < 1:
            continue
        dx, dy = dx / length, dy / length
        for j in range(steps):
            u, v = np.uint64(ax + j * dx), np.uint64(ay + j * dy)
            if grid.stamp[v, u] != number:
                grid.stamp[v, u] = number
                grid.weight[v, u] = max(grid.weight[v, u], unknown_weight)
                observe(grid, u, v, -1.0, free, max_weight)


@njit(fastmath=FAST, inner=True, borrows=True)
def darkness(grid: Grid, x: float, y: float) -> float:
    """Darkness of the map at (x, y) [cells]: 0 where unknown or free, 1 on a wall.

    ours: smooth, by quadratic B-splines over the 3 x 3 cells around the point.
    """
    height, width = grid.gray.shape
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
        left, middle = max(grid.gray[i, ix - one], 0.0), max(grid.gray[i, ix], 0.0)
        total += row * (a * left + b * middle + c * max(grid.gray[i, ix + one], 0.0))
    return total
