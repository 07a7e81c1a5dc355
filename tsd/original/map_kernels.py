"""The published TSD grid: partitions, push by back-projection, ray cast of the model scan."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats
from tsd.original.scan_kernels import Mask, Sensor

PARTITION_SIDE = 32  # cells along the edge of a partition; LAYOUT_32x32 of the original code
BLOCK_SIDE = 8  # cells along the edge of the blocks that rays jump over


class Grid(NamedTuple):
    """Normalized distances `tsd` in [-1, 1] (nan unknown) and `weight`, both (ny, nx).

    For partitions of PARTITION_SIDE cells: `allocated`, whether cells were ever written, and
    `emptiness`, how often the whole partition was observed as free before that. For blocks of
    BLOCK_SIDE cells: `near`, whether interpolation may give a distance below zero.
    `corner` (2,) [m] is the outer corner of cell [0, 0], `truncation` in m.
    """

    tsd: NDArray[np.float32]
    weight: NDArray[np.float32]
    allocated: Mask
    emptiness: Floats
    near: Mask
    corner: Floats
    cell: float
    truncation: float


@njit(inner=True)
def beam_of(x: float, y: float, pose: Floats, sensor: Sensor, n_beams: int) -> int:
    """Index of the beam towards a point; -1 after the last, -2 before the first. [May14]."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = x - pose[0], y - pose[1]
    phi = math.atan2(c * dy - s * dx, c * dx + s * dy)
    beam = math.floor((phi - sensor.angle_min) / sensor.angle_increment + 0.5)
    if beam < 0:
        return -2
    return -1 if beam >= n_beams else int(beam)


@njit(inner=True)
def add_distance(grid: Grid, iy: int, ix: int, tsd: float, weight: float, cap: float) -> None:
    """Running weighted mean of a cell [May14]; addTsd of the original code."""
    old = grid.weight[iy, ix]
    if grid.tsd[iy, ix] != grid.tsd[iy, ix]:
        grid.tsd[iy, ix] = tsd
        grid.weight[iy, ix] = old + weight
    else:
        grid.tsd[iy, ix] = (grid.tsd[iy, ix] * old + tsd * weight) / (old + weight)
        grid.weight[iy, ix] = min(old + weight, cap)
    if grid.tsd[iy, ix] <= 0.0:
        low_y, low_x = max(iy - 1, 0) // BLOCK_SIDE, max(ix - 1, 0) // BLOCK_SIDE
        grid.near[low_y, low_x] = grid.near[low_y, ix // BLOCK_SIDE] = True
        grid.near[iy // BLOCK_SIDE, low_x] = grid.near[iy // BLOCK_SIDE, ix // BLOCK_SIDE] = True


@njit(inner=True)
def add_emptiness(grid: Grid, py: int, px: int, cap: float) -> None:
    """Update a partition that was observed as free, with the weight of 100 beams. Original code."""
    if not grid.allocated[py, px]:
        grid.emptiness[py, px] = min(grid.emptiness[py, px] + 1.0, cap)
        return
    for iy in range(py * PARTITION_SIDE, (py + 1) * PARTITION_SIDE):
        for ix in range(px * PARTITION_SIDE, (px + 1) * PARTITION_SIDE):
            if grid.tsd[iy, ix] != grid.tsd[iy, ix]:
                grid.tsd[iy, ix] = 1.0
                grid.weight[iy, ix] += 1.0
            else:
                w = min(grid.weight[iy, ix] + 1.0, cap)
                grid.tsd[iy, ix] = (grid.tsd[iy, ix] * (w - 1.0) + 1.0) / w
                grid.weight[iy, ix] = w


@njit(inner=True)
def allocate(grid: Grid, py: int, px: int) -> None:
    """Allocate a partition: unknown cells, or free cells with its emptiness as weight. [May14]."""
    grid.allocated[py, px] = True
    if grid.emptiness[py, px] > 0.0:
        for iy in range(py * PARTITION_SIDE, (py + 1) * PARTITION_SIDE):
            for ix in range(px * PARTITION_SIDE, (px + 1) * PARTITION_SIDE):
                grid.tsd[iy, ix] = 1.0
                grid.weight[iy, ix] = grid.emptiness[py, px]


@njit(inner=True)
def partition_state(
    grid: Grid, py: int, px: int, pose: Floats, ranges: Floats, mask: Mask, sensor: Sensor
) -> int:
    """0 not observed, 1 observed as empty, 2 to be updated. [May14] early tests per partition."""
    size = PARTITION_SIDE * grid.cell
    x0 = grid.corner[0] + px * size + 0.5 * grid.cell
    y0 = grid.corner[1] + py * size + 0.5 * grid.cell
    distance = math.hypot(x0 + 0.5 * size - pose[0], y0 + 0.5 * size - pose[1])
    reach = size * math.sqrt(0.5) + grid.truncation
    near, far = distance - reach, distance + reach
    if near > sensor.range_max or far < sensor.range_min:
        return 0
    n = ranges.shape[0]
    first, last, outside = n, -1, 0
    for corner in range(4):
        b = beam_of(x0 + (corner % 2) * size, y0 + (corner // 2) * size, pose, sensor, n)
        outside += b < 0
        b = n - 1 if b == -1 else max(b, 0)
        first, last = min(first, b), max(last, b)
    if outside == 4:
        return 0
    visible, empty = False, outside == 0
    for j in range(first, last + 1):
        visible = visible or (mask[j] and ranges[j] > near)
        if ranges[j] == math.inf:
            empty = empty and distance < sensor.low_reflectivity
        else:
            empty = empty and mask[j] and ranges[j] > far
    if not visible:
        return 0
    return 1 if empty else 2


@njit(inner=True)
def push_partition(
    grid: Grid, py: int, px: int, pose: Floats, ranges: Floats, mask: Mask, sensor: Sensor
) -> None:
    """Add range minus distance to every cell of a partition. [May14] push."""
    size = PARTITION_SIDE * grid.cell
    x0, y0 = grid.corner[0] + px * size, grid.corner[1] + py * size
    half = 0.5 * (size + grid.cell)
    distance = math.hypot(x0 + half - pose[0], y0 + half - pose[1])
    share = 1.0 - min(distance, sensor.range_max) / sensor.range_max
    weight = sensor.weight_unit * share * share
    for j in range(PARTITION_SIDE):
        y = y0 + (j + 0.5) * grid.cell
        for i in range(PARTITION_SIDE):
            x = x0 + (i + 0.5) * grid.cell
            b = beam_of(x, y, pose, sensor, ranges.shape[0])
            if b < 0 or not mask[b]:
                continue
            dx, dy = x - pose[0], y - pose[1]
            d = math.sqrt(dx * dx + dy * dy)
            sd = ranges[b] - d
            if ranges[b] == math.inf:
                if d >= sensor.low_reflectivity:
                    continue
                sd = grid.truncation
            if sd >= -grid.truncation:
                tsd = min(sd / grid.truncation, 1.0)
                iy, ix = py * PARTITION_SIDE + j, px * PARTITION_SIDE + i
                add_distance(grid, iy, ix, tsd, weight, sensor.max_weight)


@njit
def push(grid: Grid, pose: Floats, ranges: Floats, mask: Mask, sensor: Sensor) -> int:
    """Push a scan taken at pose (3,) of the laser; returns the partitions updated. [May14]."""
    updated = 0
    for py in range(grid.allocated.shape[0]):
        for px in range(grid.allocated.shape[1]):
            state = partition_state(grid, py, px, pose, ranges, mask, sensor)
            if state == 1:
                add_emptiness(grid, py, px, sensor.max_weight)
            elif state == 2:
                if not grid.allocated[py, px]:
                    allocate(grid, py, px)
                push_partition(grid, py, px, pose, ranges, mask, sensor)
                updated += 1
    return updated


@njit
def clear_box(grid: Grid, x0: float, y0: float, x1: float, y1: float) -> None:
    """Mark the robot's footprint as free, without weight. Original code: freeFootprint."""
    for iy in range(
        round((y0 - grid.corner[1]) / grid.cell), round((y1 - grid.corner[1]) / grid.cell)
    ):
        for ix in range(
            round((x0 - grid.corner[0]) / grid.cell), round((x1 - grid.corner[0]) / grid.cell)
        ):
            if 0 <= iy < grid.tsd.shape[0] and 0 <= ix < grid.tsd.shape[1]:
                if not grid.allocated[iy // PARTITION_SIDE, ix // PARTITION_SIDE]:
                    allocate(grid, iy // PARTITION_SIDE, ix // PARTITION_SIDE)
                grid.tsd[iy, ix] = 1.0


@njit(inner=True)
def interpolate(grid: Grid, x: float, y: float) -> float:
    """Bilinear tsd between the four surrounding cell centers, nan where one is unknown. [May14]."""
    u = (x - grid.corner[0]) / grid.cell - 0.5
    v = (y - grid.corner[1]) / grid.cell - 0.5
    fx, fy = math.floor(u), math.floor(v)
    ix, iy = int(fx), int(fy)
    if ix < 0 or iy < 0 or ix >= grid.tsd.shape[1] - 1 or iy >= grid.tsd.shape[0] - 1:
        return math.nan
    wx, wy = u - fx, v - fy
    low = grid.tsd[iy, ix] * (1.0 - wx) + grid.tsd[iy, ix + 1] * wx
    high = grid.tsd[iy + 1, ix] * (1.0 - wx) + grid.tsd[iy + 1, ix + 1] * wx
    return float(low * (1.0 - wy) + high * wy)


@njit(inner=True)
def has_cells(grid: Grid, x: float, y: float) -> bool:
    """Whether the partition around a point is allocated. Original code: EMPTYPARTITION."""
    px = math.floor((x - grid.corner[0]) / (grid.cell * PARTITION_SIDE))
    py = math.floor((y - grid.corner[1]) / (grid.cell * PARTITION_SIDE))
    inside = 0 <= px < grid.allocated.shape[1] and 0 <= py < grid.allocated.shape[0]
    return inside and bool(grid.allocated[py, px])


@njit(inner=True)
def ray_length(
    grid: Grid, pose: Floats, dx: float, dy: float, sensor: Sensor
) -> tuple[float, float]:
    """Distances in cells at which a ray enters and leaves the grid, within the range. [May14]."""
    near, far = sensor.range_min / grid.cell, sensor.range_max / grid.cell
    for axis in range(2):
        d = dx if axis == 0 else dy
        if abs(d) > 1e-5:
            cells = grid.tsd.shape[1 - axis] - 1
            a = (grid.corner[axis] - pose[axis]) / (d * grid.cell)
            b = (grid.corner[axis] + cells * grid.cell - pose[axis]) / (d * grid.cell)
            near, far = max(near, min(a, b)), min(far, max(a, b))
    return near, far


@njit(inner=True)
def steps_to_skip(grid: Grid, pose: Floats, k: float, dx: float, dy: float) -> float:
    """Number of steps of a ray from step k on in a block without a surface; 0 near a surface.

    ours: the distance has no zero there.
    """
    u = (pose[0] - grid.corner[0]) / grid.cell - 0.5 + k * dx
    v = (pose[1] - grid.corner[1]) / grid.cell - 0.5 + k * dy
    bx, by = math.floor(u / BLOCK_SIDE), math.floor(v / BLOCK_SIDE)
    if bx < 0 or by < 0 or bx >= grid.near.shape[1] or by >= grid.near.shape[0]:
        return 0.0
    if grid.near[by, bx]:
        return 0.0
    to_x = (bx + (dx > 0.0)) * BLOCK_SIDE - u
    to_y = (by + (dy > 0.0)) * BLOCK_SIDE - v
    steps = min(to_x / dx if dx != 0.0 else 1e9, to_y / dy if dy != 0.0 else 1e9)
    return max(math.floor(steps - 1e-6) + 1.0, 1.0)


@njit(inner=True)
def cast_ray(grid: Grid, pose: Floats, dx: float, dy: float, sensor: Sensor) -> float:
    """Distance [m] to the first zero crossing from + to -, nan if there is none. [May14]."""
    k, far = ray_length(grid, pose, dx, dy, sensor)
    step = grid.cell
    while k < far and not has_cells(grid, pose[0] + k * step * dx, pose[1] + k * step * dy):
        k += PARTITION_SIDE
    before = interpolate(grid, pose[0] + k * step * dx, pose[1] + k * step * dy)
    k += 1.0
    while k <= far + 1.0:
        jump = 0.0 if before < 0.0 else steps_to_skip(grid, pose, k, dx, dy)
        if jump > 0.0:
            k += jump
            before = interpolate(
                grid, pose[0] + (k - 1.0) * step * dx, pose[1] + (k - 1.0) * step * dy
            )
            continue
        now = interpolate(grid, pose[0] + k * step * dx, pose[1] + k * step * dy)
        if before > 0.0 and now < 0.0:
            return (k - 1.0 + before / (before - now)) * step
        if before < 0.0 and now > 0.0:
            return math.nan
        before = now
        k += 1.0
    return math.nan


@njit
def cast_rays(grid: Grid, pose: Floats, sensor: Sensor, out_points: Floats, out_mask: Mask) -> int:
    """Model scan: the scan that the sensor would measure in the grid. [May14] ray cast.

    out_points (n, 2) [m] in the laser frame, in beam order; out_mask (n,), false for a point next
    to unknown cells, where no normal can be computed. Returns the number of valid points.
    """
    count = 0
    for i in range(out_mask.shape[0]):
        angle = sensor.angle_min + i * sensor.angle_increment
        c, s = math.cos(pose[2] + angle), math.sin(pose[2] + angle)
        d = cast_ray(grid, pose, c, s, sensor)
        out_mask[i] = False
        if d != d:
            continue
        x, y, h = pose[0] + d * c, pose[1] + d * s, grid.cell
        slope = interpolate(grid, x + h, y) - interpolate(grid, x - h, y)
        slope += interpolate(grid, x, y + h) - interpolate(grid, x, y - h)
        if slope == slope:
            out_points[i, 0] = d * math.cos(angle)
            out_points[i, 1] = d * math.sin(angle)
            out_mask[i] = True
            count += 1
    return count
