"""Kernels of the surface layer: where exactly, inside a cell, the wall stands.

ours: the occupancy of a cell knows a wall only to the cell. Here each cell near a wall keeps the
mean point and the mean normal of the hits around it, so that the matcher sees a signed distance to
a line instead of a step of probability. A cell has two layers: the faces of a thin wall have
opposite normals, and a corner has two walls.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.scan.scan_kernels import Points
from slams.types import Pose2

LAYERS = 2
SUMS = 7  # of a layer


class Surface(NamedTuple):
    """Lines of the cells near walls, in a pool that cells point into.

    `slot` (ny, nx) [iy, ix] the cell's row in the pool, 0 = none; for each of two layers `sums`
    (k, 14) has weight, sums of x and y [m] from the cell's center, sums of the normal, the number
    of scans that hit it and the last of them; `lines` (k, 8) the unit normal toward the free side,
    its distance from the map's origin [m] and the trust 0..1; `used` (1,) the last row taken.
    `seen` (ny, nx) what the grid of the same cells says: cells below `free` are free; x0, y0 [m]
    the center of cell [0, 0].
    """

    slot: NDArray[np.int32]
    sums: NDArray[np.float32]
    lines: NDArray[np.float32]
    used: NDArray[np.int64]
    seen: NDArray[np.float32]
    x0: float
    y0: float
    resolution: float
    free: float


class Splat(NamedTuple):
    """How hits enter the lines: cells reached across and along the wall, cap of the weight.

    `number` counts the scans that have entered; `once` is the trust in a line of one scan alone.
    """

    reach: int
    side: int
    cap: float
    number: int
    once: float


class Hits(NamedTuple):
    """Several hits of one cell: their number, mean point [m] and mean normal."""

    n: float
    x: float
    y: float
    nx: float
    ny: float


@njit(inner=True, borrows=True)
def add_to_cell(surface: Surface, ix: int, iy: int, hits: Hits, splat: Splat) -> None:
    """Add hits to the layer of this cell with a like normal.

    ours: means of points and normals; beyond the weight `cap` the mean follows slowly. What one
    scan saw alone may have been a leg: it is trusted by `once`.
    """
    cx, cy = surface.x0 + ix * surface.resolution, surface.y0 + iy * surface.resolution
    sums, lines = surface.sums, surface.lines
    row = np.uint64(surface.slot[iy, ix])
    if row == 0:
        if surface.used[0] + 1 >= lines.shape[0]:
            return
        surface.used[0] += 1
        surface.slot[iy, ix] = surface.used[0]
        row = np.uint64(surface.used[0])
    for layer in range(LAYERS):
        k, q = SUMS * layer, 4 * layer
        w, mx, my = sums[row, k], sums[row, k + 3], sums[row, k + 4]
        along = mx * hits.nx + my * hits.ny
        if w > 0.0 and (along <= 0.0 or along * along < 0.5 * (mx * mx + my * my)):
            continue
        keep = (splat.cap - hits.n) / w if w > splat.cap - hits.n else 1.0
        terms = (1.0, hits.x - cx, hits.y - cy, hits.nx, hits.ny)
        for i in range(5):
            sums[row, k + i] = keep * sums[row, k + i] + hits.n * terms[i]
        w, mx, my = sums[row, k], sums[row, k + 3], sums[row, k + 4]
        length = math.sqrt(mx * mx + my * my)
        ex, ey = mx / length, my / length
        lines[row, q], lines[row, q + 1] = ex, ey
        lines[row, q + 2] = ex * (cx + sums[row, k + 1] / w) + ey * (cy + sums[row, k + 2] / w)
        if sums[row, k + 6] != splat.number:
            sums[row, k + 5] += 1.0
            sums[row, k + 6] = splat.number
        scans = sums[row, k + 5]
        lines[row, q + 3] = length / (w + 2.0) * (splat.once if scans < 2.0 else 1.0 - 1.0 / scans)
        break


@njit(inner=True, borrows=True)
def spread(surface: Surface, hits: Hits, gap: float, splat: Splat) -> None:
    """Add hits of one cell to it and to cells around.

    ours: `reach` cells along the normal to both sides, so that a wall on the border of two cells
    is not cut in two, and along the wall halfway over the `gap` [m] to the next beam.
    """
    height, width = surface.slot.shape
    scale = 1.0 / surface.resolution
    fx, fy = (hits.x - surface.x0) * scale + 0.5, (hits.y - surface.y0) * scale + 0.5
    side = int(0.5 * gap * scale + 0.5)
    side = splat.side if side > splat.side else side
    length = math.sqrt(hits.nx * hits.nx + hits.ny * hits.ny)
    nx, ny = hits.nx / length, hits.ny / length
    for j in range(-side, side + 1):
        for k in range(-splat.reach, splat.reach + 1):
            ix, iy = math.floor(fx + k * nx - j * ny), math.floor(fy + k * ny + j * nx)
            if 0 <= ix < width and 0 <= iy < height:
                add_to_cell(surface, ix, iy, hits, splat)


@njit(inner=True, borrows=True)
def wall_behind(surface: Surface, x: float, y: float, nx: float, ny: float) -> bool:
    """Whether one cell against the normal (nx, ny) of a hit at (x, y) [m] stands a wall.

    ours: noise brings hits of a wall near its cell's border into the cell in front, which is mostly
    seen free. Without them the line would be the mean of the farther hits, millimeters too far.
    """
    height, width = surface.seen.shape
    scale = 1.0 / surface.resolution
    length = math.sqrt(nx * nx + ny * ny)
    ix = math.floor((x - surface.x0) * scale - nx / length + 0.5)
    iy = math.floor((y - surface.y0) * scale - ny / length + 0.5)
    return bool(0 <= ix < width and 0 <= iy < height and surface.seen[iy, ix] > 0.0)


@njit
def add_scan(
    surface: Surface, points: Points, normals: Points, n: int, pose: Pose2, splat: Splat
) -> None:
    """Add every end point that has a normal; points (2, >= n), normals (3, >= n) in the base frame.

    ours: neighbors that fall into one cell with like normals are added together. What stands where
    it was free most of the time is no wall, unless the next cell behind it is one.
    """
    height, width = surface.slot.shape
    scale = 1.0 / surface.resolution
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    count = x = y = nx = ny = gap = 0.0
    cell_x = cell_y = 0
    for i in range(n):
        ax, ay = normals[0, i], normals[1, i]
        if ax == 0.0 and ay == 0.0:
            continue
        bx, by = c * ax - s * ay, s * ax + c * ay
        px = pose.x + c * points[0, i] - s * points[1, i]
        py = pose.y + s * points[0, i] + c * points[1, i]
        ix = math.floor((px - surface.x0) * scale + 0.5)
        iy = math.floor((py - surface.y0) * scale + 0.5)
        if not (0 <= ix < width and 0 <= iy < height):
            continue
        if surface.seen[iy, ix] < 0.0 and not wall_behind(surface, px, py, bx, by):
            continue
        alike = nx * bx + ny * by > 0.9 * count
        if count > 0.0 and not (ix == cell_x and iy == cell_y and alike):
            spread(surface, Hits(count, x / count, y / count, nx / count, ny / count), gap, splat)
            count = x = y = nx = ny = gap = 0.0
        cell_x, cell_y = ix, iy
        count += 1.0
        x, y, nx, ny = x + px, y + py, nx + bx, ny + by
        gap = normals[2, i] if normals[2, i] > gap else gap
    if count > 0.0:
        spread(surface, Hits(count, x / count, y / count, nx / count, ny / count), gap, splat)
