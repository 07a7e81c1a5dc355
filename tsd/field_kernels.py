"""The directional TSD field: four layers of tiles, one per facing of a surface."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats
from tsd.surface_kernels import Beams

SIDE = 8  # cells per tile edge
SHARED = 0.55  # a surface is written to every layer whose axis is within 57 degrees of its normal


class Field(NamedTuple):
    """Tiles of signed distances in four layers (surfaces facing +x, +y, -x, -y).

    `slots` (4, ny, nx) gives each tile's place in the pool, -1 = none; `tsd` [m] (n, SIDE, SIDE) is
    nan where unknown. `corner` (2,) [m] is the outer corner of tile [0, 0]. `used` (1,) counts
    slots taken, `stamp` (ny, nx) the last push that visited a tile, `visited` its list. `seen`
    (ny SIDE, nx SIDE) is 1 where a beam passed.
    """

    slots: NDArray[np.int32]
    tsd: NDArray[np.float32]
    weight: NDArray[np.float32]
    corner: Floats
    cell: float
    used: NDArray[np.int64]
    stamp: NDArray[np.int64]
    visited: NDArray[np.int64]
    seen: NDArray[np.uint8]


class PushRule(NamedTuple):
    """How a scan enters the field: truncation [m], weight cap, push number."""

    truncation: float
    max_weight: float
    number: int


@njit
def facing(nx: float, ny: float) -> int:
    """Layer of a surface with this normal: 0 +x, 1 +y, 2 -x, 3 -y. ours."""
    if abs(nx) >= abs(ny):
        return 0 if nx >= 0.0 else 2
    return 1 if ny >= 0.0 else 3


@njit
def cell_value(field: Field, layer: int, iy: int, ix: int) -> float:
    """Signed distance [m] in one cell, nan where unknown or outside. ours."""
    ty, tx = iy // SIDE, ix // SIDE
    if ty < 0 or tx < 0 or ty >= field.slots.shape[1] or tx >= field.slots.shape[2]:
        return math.nan
    slot = field.slots[layer, ty, tx]
    if slot < 0:
        return math.nan
    return float(field.tsd[slot, iy - ty * SIDE, ix - tx * SIDE])


@njit
def read_field(field: Field, layer: int, x: float, y: float) -> tuple[float, float, float]:
    """Bilinear signed distance [m] and its gradient at a point; nan next to unknown cells.

    [May14] interpolation between the four surrounding cell centers; ours: the gradient is that
    of the interpolant (A1).
    """
    u = (x - field.corner[0]) / field.cell - 0.5
    v = (y - field.corner[1]) / field.cell - 0.5
    fx, fy = math.floor(u), math.floor(v)
    ix, iy = int(fx), int(fy)
    wx, wy = u - fx, v - fy
    ty, tx = iy // SIDE, ix // SIDE
    jy, jx = iy - ty * SIDE, ix - tx * SIDE
    if jy < SIDE - 1 and jx < SIDE - 1:
        if ty < 0 or tx < 0 or ty >= field.slots.shape[1] or tx >= field.slots.shape[2]:
            return math.nan, 0.0, 0.0
        slot = field.slots[layer, ty, tx]
        if slot < 0:
            return math.nan, 0.0, 0.0
        a, b = float(field.tsd[slot, jy, jx]), float(field.tsd[slot, jy, jx + 1])
        c, d = float(field.tsd[slot, jy + 1, jx]), float(field.tsd[slot, jy + 1, jx + 1])
    else:
        a, b = cell_value(field, layer, iy, ix), cell_value(field, layer, iy, ix + 1)
        c, d = cell_value(field, layer, iy + 1, ix), cell_value(field, layer, iy + 1, ix + 1)
    low, high = a + wx * (b - a), c + wx * (d - c)
    gx = ((b - a) * (1.0 - wy) + (d - c) * wy) / field.cell
    return low + wy * (high - low), gx, (high - low) / field.cell


@njit
def take_tiles(
    field: Field,
    x: float,
    y: float,
    reach_x: float,
    reach_y: float,
    layers: int,
    number: int,
    n_visited: int,
) -> int:
    """Make sure that the tiles in a box exist in the given layers (bit mask) and list them.

    ours: S2, only the cells near surfaces are visited. Returns the new length of the list, or -1
    when the pool is full.
    """
    size = field.cell * SIDE
    x0 = math.floor((x - reach_x - field.corner[0]) / size)
    x1 = math.floor((x + reach_x - field.corner[0]) / size)
    y0 = math.floor((y - reach_y - field.corner[1]) / size)
    y1 = math.floor((y + reach_y - field.corner[1]) / size)
    ny, nx = field.stamp.shape
    for ty in range(max(y0, 0), min(y1 + 1, ny)):
        for tx in range(max(x0, 0), min(x1 + 1, nx)):
            for layer in range(4):
                if (layers >> layer) & 1 and field.slots[layer, ty, tx] < 0:
                    if field.used[0] >= field.tsd.shape[0]:
                        return -1
                    field.slots[layer, ty, tx] = field.used[0]
                    field.used[0] += 1
            if field.stamp[ty, tx] != number:
                field.stamp[ty, tx] = number
                field.visited[n_visited] = ty * nx + tx
                n_visited += 1
    return n_visited


@njit
def layer_mask(nx: float, ny: float) -> int:
    """Bit mask of the layers a surface is written to (one or two). ours."""
    mask = 0
    if abs(nx) >= SHARED:
        mask |= 1 if nx > 0.0 else 4
    if abs(ny) >= SHARED:
        mask |= 2 if ny > 0.0 else 8
    return mask


@njit
def list_tiles(field: Field, lines: Floats, count: int, half_gap: Floats, rule: PushRule) -> int:
    """List the tiles within the truncation of any surface. ours: S2.

    lines (n, 7) in the map: x, y, normal x, y, weight, mask of layers, distance [m].
    Returns the length of the list, -1 when the pool is full (nothing is lost: call again).
    """
    n_visited = 0
    for k in range(count):
        reach = rule.truncation
        tx, ty = abs(lines[k, 3]) * half_gap[k], abs(lines[k, 2]) * half_gap[k]
        n_visited = take_tiles(
            field,
            lines[k, 0],
            lines[k, 1],
            reach + tx,
            reach + ty,
            int(lines[k, 5]),
            rule.number,
            n_visited,
        )
        if n_visited < 0:
            return -1
    return n_visited


@njit
def place_lines(
    surfaces: Floats,
    count: int,
    hits: Floats,
    beams: Beams,
    pose: Floats,
    out_lines: Floats,
    out_gaps: Floats,
    out_line_of_beam: NDArray[np.int64],
) -> None:
    """Surface elements in the map, and which beam sees which. ours: A5.

    surfaces (n, 6) as made by `fit_surfaces`; pose (3,) of the base; out_lines as in
    `list_tiles`; out_gaps (n,) [m] half the spacing of the hits along the surface.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    out_line_of_beam[:] = -1
    for k in range(count):
        nx = c * surfaces[k, 2] - s * surfaces[k, 3]
        ny = s * surfaces[k, 2] + c * surfaces[k, 3]
        out_lines[k, 0] = pose[0] + c * surfaces[k, 0] - s * surfaces[k, 1]
        out_lines[k, 1] = pose[1] + s * surfaces[k, 0] + c * surfaces[k, 1]
        out_lines[k, 2] = nx
        out_lines[k, 3] = ny
        rx, ry = beams.mount_x - surfaces[k, 0], beams.mount_y - surfaces[k, 1]
        r = math.sqrt(rx * rx + ry * ry) + 1e-9
        cosine = max((rx * surfaces[k, 2] + ry * surfaces[k, 3]) / r, 0.1)
        out_lines[k, 4] = cosine
        out_lines[k, 5] = layer_mask(nx, ny)
        out_lines[k, 6] = r
        out_gaps[k] = min(0.5 * r * abs(beams.angle_increment) / cosine, 0.5)
        out_line_of_beam[int(hits[int(surfaces[k, 5]), 3])] = k


@njit
def blend(field: Field, slot: int, j: int, i: int, value: float, weight: float, cap: float) -> None:
    """Running weighted mean of one cell. [May14] update of tsd and weight."""
    old = float(field.weight[slot, j, i])
    if old <= 0.0:
        field.tsd[slot, j, i] = value
        field.weight[slot, j, i] = weight
        return
    total = old + weight
    field.tsd[slot, j, i] += (value - field.tsd[slot, j, i]) * weight / total
    field.weight[slot, j, i] = min(total, cap)


@njit
def update_tiles(
    field: Field,
    n_visited: int,
    lines: Floats,
    line_of_beam: NDArray[np.int64],
    beams: Beams,
    pose: Floats,
    rule: PushRule,
) -> None:
    """Push: every cell of the listed tiles takes its distance to the line its beam hit.

    [May14] push by back-projection; ours: distance to the local line instead of along the ray,
    each surface in the layers it faces, free space only erases what contradicts it.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    sx = pose[0] + c * beams.mount_x - s * beams.mount_y
    sy = pose[1] + s * beams.mount_x + c * beams.mount_y
    start = pose[2] + beams.mount_theta + beams.angle_min
    n_beams = line_of_beam.shape[0]
    turn = 2.0 * math.pi / abs(beams.angle_increment)
    nx_tiles = field.stamp.shape[1]
    tau = rule.truncation
    for n in range(n_visited):
        ty, tx = field.visited[n] // nx_tiles, field.visited[n] % nx_tiles
        for j in range(SIDE):
            y = field.corner[1] + (ty * SIDE + j + 0.5) * field.cell
            for i in range(SIDE):
                x = field.corner[0] + (tx * SIDE + i + 0.5) * field.cell
                beam = (math.atan2(y - sy, x - sx) - start) / beams.angle_increment
                beam -= turn * math.floor((beam + 0.5) / turn)
                b = math.floor(beam + 0.5)
                if b < 0 or b >= n_beams:
                    continue
                k = line_of_beam[b]
                if k < 0:
                    continue
                sd = lines[k, 2] * (x - lines[k, 0]) + lines[k, 3] * (y - lines[k, 1])
                if sd > tau or sd < -tau:
                    continue
                mask = int(lines[k, 5])
                weight = lines[k, 4] if sd > 0.0 else lines[k, 4] * (1.0 + sd / tau)
                for layer in range(4):
                    slot = field.slots[layer, ty, tx]
                    if (mask >> layer) & 1 and slot >= 0 and weight > 0.0:
                        blend(field, slot, j, i, sd, weight, rule.max_weight)


@njit
def forget(field: Field, layer: int, ix: int, iy: int) -> bool:
    """Contradict one cell; true when nothing is left of its weight. ours: halved each time."""
    slot = field.slots[layer, iy // SIDE, ix // SIDE]
    j, i = iy % SIDE, ix % SIDE
    if slot < 0 or not field.tsd[slot, j, i] < -field.cell:
        return False
    field.weight[slot, j, i] *= 0.5
    return bool(field.weight[slot, j, i] < 0.5)


@njit
def carve(
    field: Field, lines: Floats, count: int, x: float, y: float, gap: float, rule: PushRule
) -> None:
    """Note the cells that beams from the laser at x, y passed, and forget walls they crossed.

    ours: free space costs one beam per cell, not one update per cell; only a beam that crosses a
    surface from its front and goes on for two truncations contradicts it (D2, D8). A cell behind
    the surface loses its weight, and with its last the surface in front of it goes too.
    gap [rad] between beams.
    """
    back = int(rule.truncation / field.cell) + 1
    k = 0
    while k < count:
        dx, dy = lines[k, 0] - x, lines[k, 1] - y
        r = math.sqrt(dx * dx + dy * dy) + 1e-9
        dx, dy = dx / r, dy / r
        layer = facing(-dx, -dy)
        u, v = (x - field.corner[0]) / field.cell, (y - field.corner[1]) / field.cell
        for step in range(int(r / field.cell)):
            ix, iy = math.floor(u + step * dx), math.floor(v + step * dy)
            field.seen[iy, ix] = 1
            crossed = r - step * field.cell > 2.0 * rule.truncation
            if crossed and forget(field, layer, ix, iy):
                for s in range(max(step - back, 0), step + 1):
                    clear(field, layer, math.floor(u + s * dx), math.floor(v + s * dy))
        k += max(int(field.cell / max(gap * r, 1e-6)), 1)


@njit
def clear(field: Field, layer: int, ix: int, iy: int) -> None:
    """Make a cell unknown. ours."""
    slot = field.slots[layer, iy // SIDE, ix // SIDE]
    if slot >= 0:
        field.tsd[slot, iy % SIDE, ix % SIDE] = math.nan
        field.weight[slot, iy % SIDE, ix % SIDE] = 0.0
