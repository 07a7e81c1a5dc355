"""Kernels of the line cells: the line of the wall inside each cell of a grid.

ours: occupancy gives the position of a wall only to a cell. Here each cell near a wall keeps the
mean point and the mean normal of the hits around it, so that a match has the signed distance to a
line instead of a step of probability. A cell has two lines: a thin wall has two faces with opposite
normals, and a corner has two walls.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.scan.scan_kernels import Points
from slams.types import Pose2

LINES_PER_CELL = 2
SUMS_PER_LINE = 7


class LineCells(NamedTuple):
    """Lines of the cells near walls, in a pool that the cells point into.

    `slot` (ny, nx) [iy, ix]: row of the cell in the pool, 0 = none. For each of two lines `sums`
    (k, 14) has weight, sums of x and y [m] from the cell's center, sums of the normal, number of
    scans that hit it and the last of them; `lines` (k, 8) has the unit normal toward free space,
    its distance from the map's origin [m] and the confidence 0..1. `used` (1,): last row in use.
    `grid` (ny, nx): value of the occupancy grid, free below `free`; x0, y0 [m]: center of [0, 0].
    """

    slot: NDArray[np.int32]
    sums: NDArray[np.float32]
    lines: NDArray[np.float32]
    used: NDArray[np.int64]
    grid: NDArray[np.float32]
    x0: float
    y0: float
    resolution: float
    free: float


class LineUpdate(NamedTuple):
    """How the hits of a scan enter the lines: cells across and along the wall, cap of the weight.

    `number` of the scan; `first_confidence` is that of a line from one scan alone.
    """

    reach: int
    side: int
    cap: float
    number: int
    first_confidence: float


class Hits(NamedTuple):
    """Hits of a scan in one cell: their number, mean point [m] and mean normal."""

    n: float
    x: float
    y: float
    nx: float
    ny: float


@njit(inner=True, borrows=True)
def add_to_cell(cells: LineCells, ix: int, iy: int, hits: Hits, update: LineUpdate) -> None:
    """Add hits to the line of one cell whose normal is similar.

    ours: means of points and normals; from the weight `cap` on they are exponential means. Hits of
    a single scan may be a person's leg, so that their line has `first_confidence`.
    """
    cx, cy = cells.x0 + ix * cells.resolution, cells.y0 + iy * cells.resolution
    sums, lines = cells.sums, cells.lines
    row = np.uint64(cells.slot[iy, ix])
    if row == 0:
        if cells.used[0] + 1 >= lines.shape[0]:
            return
        cells.used[0] += 1
        cells.slot[iy, ix] = cells.used[0]
        row = np.uint64(cells.used[0])
    for line in range(LINES_PER_CELL):
        k, q = SUMS_PER_LINE * line, 4 * line
        w, mx, my = sums[row, k], sums[row, k + 3], sums[row, k + 4]
        along = mx * hits.nx + my * hits.ny
        if w > 0.0 and (along <= 0.0 or along * along < 0.5 * (mx * mx + my * my)):
            continue
        room = max(update.cap - hits.n, 0.0)
        keep = room / w if w > room else 1.0
        terms = (1.0, hits.x - cx, hits.y - cy, hits.nx, hits.ny)
        for i in range(5):
            sums[row, k + i] = keep * sums[row, k + i] + hits.n * terms[i]
        w, mx, my = sums[row, k], sums[row, k + 3], sums[row, k + 4]
        length = math.sqrt(mx * mx + my * my)
        ex, ey = mx / length, my / length
        lines[row, q], lines[row, q + 1] = ex, ey
        lines[row, q + 2] = ex * (cx + sums[row, k + 1] / w) + ey * (cy + sums[row, k + 2] / w)
        if sums[row, k + 6] != update.number:
            sums[row, k + 5] += 1.0
            sums[row, k + 6] = update.number
        scans = sums[row, k + 5]
        share = update.first_confidence if scans < 2.0 else 1.0 - 1.0 / scans
        lines[row, q + 3] = length / (w + 2.0) * share
        break


@njit(inner=True, borrows=True)
def add_hits(cells: LineCells, hits: Hits, gap: float, update: LineUpdate) -> None:
    """Add hits of one cell to this cell and to cells around it.

    ours: to `reach` cells on both sides of the wall, so that a wall on the border of two cells has
    one line, and along the wall over half of the `gap` [m] to the next beam.
    """
    height, width = cells.slot.shape
    scale = 1.0 / cells.resolution
    fx, fy = (hits.x - cells.x0) * scale + 0.5, (hits.y - cells.y0) * scale + 0.5
    side = int(0.5 * gap * scale + 0.5)
    side = update.side if side > update.side else side
    length = math.sqrt(hits.nx * hits.nx + hits.ny * hits.ny)
    nx, ny = hits.nx / length, hits.ny / length
    for j in range(-side, side + 1):
        for k in range(-update.reach, update.reach + 1):
            ix, iy = math.floor(fx + k * nx - j * ny), math.floor(fy + k * ny + j * nx)
            if 0 <= ix < width and 0 <= iy < height:
                add_to_cell(cells, ix, iy, hits, update)


@njit(inner=True, borrows=True)
def wall_behind(cells: LineCells, x: float, y: float, nx: float, ny: float) -> bool:
    """Whether the cell behind a hit at (x, y) [m] with the normal (nx, ny) is occupied.

    ours: noise moves hits of a wall near the border of its cell into the free cell in front.
    Without these hits the line would be the mean of the farther ones, millimeters behind the wall.
    """
    height, width = cells.grid.shape
    scale = 1.0 / cells.resolution
    length = math.sqrt(nx * nx + ny * ny)
    ix = math.floor((x - cells.x0) * scale - nx / length + 0.5)
    iy = math.floor((y - cells.y0) * scale - ny / length + 0.5)
    return bool(0 <= ix < width and 0 <= iy < height and cells.grid[iy, ix] > 0.0)


@njit
def add_scan(
    cells: LineCells, points: Points, normals: Points, n: int, pose: Pose2, update: LineUpdate
) -> None:
    """Add every end point that has a normal; points (2, >= n), normals (3, >= n) in the base frame.

    ours: neighbors in one cell with similar normals are added together. A hit in a cell that is
    mostly free belongs to no wall, unless the next cell behind it is occupied.
    """
    height, width = cells.slot.shape
    scale = 1.0 / cells.resolution
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
        ix = math.floor((px - cells.x0) * scale + 0.5)
        iy = math.floor((py - cells.y0) * scale + 0.5)
        if not (0 <= ix < width and 0 <= iy < height):
            continue
        if cells.grid[iy, ix] < 0.0 and not wall_behind(cells, px, py, bx, by):
            continue
        is_similar = nx * bx + ny * by > 0.9 * count
        if count > 0.0 and not (ix == cell_x and iy == cell_y and is_similar):
            add_hits(cells, Hits(count, x / count, y / count, nx / count, ny / count), gap, update)
            count = x = y = nx = ny = gap = 0.0
        cell_x, cell_y = ix, iy
        count += 1.0
        x, y, nx, ny = x + px, y + py, nx + bx, ny + by
        gap = normals[2, i] if normals[2, i] > gap else gap
    if count > 0.0:
        add_hits(cells, Hits(count, x / count, y / count, nx / count, ny / count), gap, update)
