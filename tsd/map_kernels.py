"""The directional TSD field: four layers of tiles, one for each axis direction of a normal."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import FAST, njit
from slams.types import Floats
from tsd.scan_kernels import Beams

TSD_TILE_SHIFT = 3
TSD_TILE_SIDE = 1 << TSD_TILE_SHIFT  # cells along the edge of a tile
TSD_TILE_MASK = TSD_TILE_SIDE - 1  # bits of a cell's index that are its place in the tile
LIKELIHOOD_STRIDE = TSD_TILE_SIDE // 2  # cells along the edge of a cell of `likelihood`
N_LAYERS = 4  # normals near +x, +y, -x, -y
MIN_LAYER_COSINE = 0.55  # of a normal to a layer's axis (57 degrees) to be written to the layer
PASS_BITS, BEHIND_BIT = 3, 4  # of `cell_state`: number of beams that passed; behind a surface

# Kernels that handle one cell are FAST and so inlined: passing a Field, fifty words, to a function
# takes longer than reading the cell.


class Field(NamedTuple):
    """Tiles of signed distances in four layers (surfaces with normals near +x, +y, -x, -y).

    `slots` (ny, nx, 4): index of each tile in the pool `tsd`; 0 is the common unknown tile.
    `tsd` (n, TSD_TILE_SIDE, TSD_TILE_SIDE) [m], nan where unknown, and `weight` of its shape.
    `corner` (2,) [m]: outer corner of tile [0, 0]. `used` (1,): number of tiles in the pool.
    `cell_state` (ny TSD_TILE_SIDE, nx TSD_TILE_SIDE): PASS_BITS, number of beams that passed, up
    to three; BEHIND_BIT, whether the cell was behind a surface. `likelihood`, LIKELIHOOD_STRIDE
    times coarser: 1 for a surface at the center of a cell of the field, 0 from the truncation on.
    """

    slots: NDArray[np.int32]
    tsd: NDArray[np.float32]
    weight: NDArray[np.float32]
    corner: Floats
    cell: float
    used: NDArray[np.int64]
    cell_state: NDArray[np.uint8]
    likelihood: NDArray[np.float32]


class PushRule(NamedTuple):
    """How a scan enters the field: truncation [m], weight limit, angle between beams [rad]."""

    truncation: float
    max_weight: float
    angle_increment: float


@njit(fastmath=FAST, inner=True)
def layer_of(nx: float, ny: float) -> int:
    """Layer of the axis nearest to a normal: 0 +x, 1 +y, 2 -x, 3 -y. ours."""
    if abs(nx) >= abs(ny):
        return 0 if nx >= 0.0 else 2
    return 1 if ny >= 0.0 else 3


@njit(fastmath=FAST, inner=True)
def second_layer_of(nx: float, ny: float) -> int:
    """Layer of the axis second nearest to a normal. ours."""
    if abs(nx) >= abs(ny):
        return 1 if ny >= 0.0 else 3
    return 0 if nx >= 0.0 else 2


@njit(fastmath=FAST, inner=True, borrows=True)
def slot_of(field: Field, layer: int, iy: int, ix: int) -> int:
    """Index in the pool of the tile that contains a cell, 0 if there is none. ours."""
    ty, tx = iy >> TSD_TILE_SHIFT, ix >> TSD_TILE_SHIFT
    if ty < 0 or tx < 0 or ty >= field.slots.shape[0] or tx >= field.slots.shape[1]:
        return 0
    return int(field.slots[ty, tx, layer])


@njit(fastmath=FAST, inner=True, borrows=True)
def cell_value(field: Field, layer: int, iy: int, ix: int) -> float:
    """Signed distance [m] in one cell, nan where unknown or outside. ours."""
    return float(field.tsd[slot_of(field, layer, iy, ix), iy & TSD_TILE_MASK, ix & TSD_TILE_MASK])


@njit(fastmath=FAST, inner=True, borrows=True)
def state_at(field: Field, x: float, y: float) -> int:
    """The `cell_state` at a point [m], 0 outside of the map. ours."""
    ix = math.floor((x - field.corner[0]) / field.cell)
    iy = math.floor((y - field.corner[1]) / field.cell)
    inside = 0 <= iy < field.cell_state.shape[0] and 0 <= ix < field.cell_state.shape[1]
    return int(field.cell_state[iy, ix]) if inside else 0


@njit(fastmath=FAST, inner=True, borrows=True)
def read_field(field: Field, layer: int, x: float, y: float) -> tuple[float, float, float]:
    """Bilinear signed distance [m] and its gradient at a point; nan next to unknown cells.

    [May14] interpolation between the four surrounding cell centers; ours: the gradient of the
    interpolant itself, so that Gauss-Newton descends the cost that it sums.
    """
    scale = 1.0 / field.cell
    u = (x - field.corner[0]) * scale - 0.5
    v = (y - field.corner[1]) * scale - 0.5
    ix, iy = math.floor(u), math.floor(v)
    wx, wy = u - ix, v - iy
    slot, jx, jy = slot_of(field, layer, iy, ix), ix & TSD_TILE_MASK, iy & TSD_TILE_MASK
    if jx < TSD_TILE_MASK and jy < TSD_TILE_MASK:
        if slot == 0:
            return math.nan, math.nan, math.nan
        a, b = float(field.tsd[slot, jy, jx]), float(field.tsd[slot, jy, jx + 1])
        c, d = float(field.tsd[slot, jy + 1, jx]), float(field.tsd[slot, jy + 1, jx + 1])
    else:
        a, b = float(field.tsd[slot, jy, jx]), cell_value(field, layer, iy, ix + 1)
        c, d = cell_value(field, layer, iy + 1, ix), cell_value(field, layer, iy + 1, ix + 1)
    low, high = a + wx * (b - a), c + wx * (d - c)
    gx = (b - a) + wy * ((d - c) - (b - a))
    return low + wy * (high - low), gx * scale, (high - low) * scale


@njit
def place_lines(
    surfaces: Floats, count: int, firsts: Floats, beams: Beams, pose: Floats, out_lines: Floats
) -> tuple[float, float, float, float]:
    """Surface elements in the map frame, as the lines that a push writes.

    ours: the published push writes the ends of beams. surfaces (n, 8) of `fit_surfaces`; firsts
    (n + 1,) of `find_runs`; pose (3,) of the base. out_lines (n, 7): x, y [m], normal x, y, cosine
    of incidence, range [m] times the number of its beams, 1 if the surface continues to the next
    line. Returns their bounding box x, y, x, y [m].
    """
    x0, y0, x1, y1 = math.inf, math.inf, -math.inf, -math.inf
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for k in range(count):
        nx, ny = surfaces[k, 2], surfaces[k, 3]
        rx, ry = beams.mount_x - surfaces[k, 0], beams.mount_y - surfaces[k, 1]
        r = math.sqrt(rx * rx + ry * ry) + 1e-9
        out_lines[k, 0] = pose[0] + c * surfaces[k, 0] - s * surfaces[k, 1]
        out_lines[k, 1] = pose[1] + s * surfaces[k, 0] + c * surfaces[k, 1]
        out_lines[k, 2] = c * nx - s * ny
        out_lines[k, 3] = s * nx + c * ny
        out_lines[k, 4] = max((rx * nx + ry * ny) / r, 0.1)
        out_lines[k, 5] = r * surfaces[k, 6]
        out_lines[k, 6] = 0.0
        if k > 0 and firsts[int(surfaces[k, 5])] == firsts[int(surfaces[k - 1, 5])]:
            out_lines[k - 1, 6] = 1.0
        x0, x1 = min(x0, out_lines[k, 0]), max(x1, out_lines[k, 0])
        y0, y1 = min(y0, out_lines[k, 1]), max(y1, out_lines[k, 1])
    return x0, y0, x1, y1


@njit
def list_rows(field: Field, lines: Floats, count: int, rule: PushRule, out_rows: Floats) -> int:
    """Rows of cells that each line crosses, up to halfway to its neighbors, in its layers.

    ours: only cells near surfaces are visited. lines (n, 7) of `place_lines`; in layers 1 and 3
    "rows" are columns. out_rows (m, 4): index of the line, layer, index of the row, where the line
    crosses the row [m from the corner]. Returns the number of rows.
    """
    n_rows = 0
    sign = math.copysign(1.0, rule.angle_increment)
    for k in range(count):
        half_length = min(0.5 * lines[k, 5] * abs(rule.angle_increment) / lines[k, 4], 0.5)
        for across in range(2):
            along = 1 - across
            nu, nv = lines[k, 2 + along], lines[k, 2 + across]
            if abs(nv) < MIN_LAYER_COSINE:
                continue
            layer = across if nv > 0.0 else across + 2
            u = lines[k, along] - field.corner[along]
            step = half_length * sign * nv * (2 * across - 1)
            before, after = u - step, u + step
            if k > 0 and lines[k - 1, 6] > 0.0:
                before = 0.5 * (u + lines[k - 1, along] - field.corner[along])
            if lines[k, 6] > 0.0:
                after = 0.5 * (u + lines[k + 1, along] - field.corner[along])
            before = min(max(before, u - rule.truncation), u + rule.truncation)
            after = min(max(after, u - rule.truncation), u + rule.truncation)
            row = math.ceil(min(before, after) / field.cell - 0.5)
            last = max(before, after) / field.cell - 0.5
            v = lines[k, across] - field.corner[across]
            while row < last and n_rows < out_rows.shape[0]:
                out_rows[n_rows, 0] = k
                out_rows[n_rows, 1] = layer
                out_rows[n_rows, 2] = row
                out_rows[n_rows, 3] = v - nu / nv * ((row + 0.5) * field.cell - u)
                row += 1
                n_rows += 1
    return n_rows


@njit(fastmath=FAST, inner=True)
def allocate_tile(field: Field) -> int:
    """Index of a new unknown tile in the pool, 0 if the pool is full. ours."""
    slot = field.used[0]
    if slot >= field.tsd.shape[0]:
        return 0
    for j in range(TSD_TILE_SIDE):
        for i in range(TSD_TILE_SIDE):
            field.tsd[slot, j, i] = math.nan
    field.used[0] += 1
    return int(slot)


@njit
def push_rows(field: Field, lines: Floats, rows: Floats, n_rows: int, rule: PushRule) -> None:
    """Push: add the distance to the line to the running weighted mean of every cell of the rows.

    [May14] update of tsd and weight; ours: distance to the local line instead of along the ray,
    in the layers of its normal, with less weight behind the surface, where no beam passed.
    """
    cell, tau = field.cell, rule.truncation
    for m in range(n_rows):
        k, layer, row, v = int(rows[m, 0]), int(rows[m, 1]), int(rows[m, 2]), rows[m, 3]
        across = layer % 2
        nv = lines[k, 2 + across]
        first = math.ceil((v - tau / abs(nv)) / cell - 0.5)
        last = math.floor((v + tau / abs(nv)) / cell - 0.5)
        for i in range(max(first, 0), last + 1):
            iy, ix = (row, i) if across == 0 else (i, row)
            ty, tx = iy >> TSD_TILE_SHIFT, ix >> TSD_TILE_SHIFT
            if iy < 0 or ix < 0 or ty >= field.slots.shape[0] or tx >= field.slots.shape[1]:
                continue
            slot = field.slots[ty, tx, layer]
            if slot == 0:
                slot = allocate_tile(field)
                if slot == 0:
                    continue
                field.slots[ty, tx, layer] = slot
            jy, jx = iy & TSD_TILE_MASK, ix & TSD_TILE_MASK
            sd = ((i + 0.5) * cell - v) * nv
            weight = lines[k, 4] * max(min(1.0 + sd / tau, 1.0), 0.01)
            old = field.weight[slot, jy, jx]
            mean = field.tsd[slot, jy, jx] if old > 0.0 else 0.0
            field.tsd[slot, jy, jx] = mean + (sd - mean) * weight / (old + weight)
            field.weight[slot, jy, jx] = min(old + weight, rule.max_weight)
            if sd < -cell:
                field.cell_state[iy, ix] |= BEHIND_BIT
            likelihood = 1.0 - abs(sd) / tau
            if likelihood > field.likelihood[iy // LIKELIHOOD_STRIDE, ix // LIKELIHOOD_STRIDE]:
                field.likelihood[iy // LIKELIHOOD_STRIDE, ix // LIKELIHOOD_STRIDE] = likelihood


@njit(fastmath=FAST, inner=True)
def decay_cell(field: Field, layer: int, iy: int, ix: int, factor: float, limit: float) -> bool:
    """Scale the weight of a cell below `limit` [m]; true if the cell became unknown.

    ours: surfaces that remain near it regain their likelihood at the next push.
    """
    ty, tx = iy >> TSD_TILE_SHIFT, ix >> TSD_TILE_SHIFT
    slot, j, i = field.slots[ty, tx, layer], iy & TSD_TILE_MASK, ix & TSD_TILE_MASK
    if slot == 0 or not field.tsd[slot, j, i] < limit:
        return False
    field.weight[slot, j, i] *= factor
    if field.weight[slot, j, i] >= 0.5:
        return False
    field.tsd[slot, j, i] = math.nan
    field.weight[slot, j, i] = 0.0
    field.likelihood[iy // LIKELIHOOD_STRIDE, ix // LIKELIHOOD_STRIDE] = 0.0
    return True


@njit
def carve(field: Field, lines: Floats, count: int, x: float, y: float, rule: PushRule) -> None:
    """Count the beams that pass each cell and remove surfaces that beams crossed.

    ours: free space costs one beam per cell instead of one update per cell. A beam from the laser
    at x, y [m] conflicts with a surface if it crosses the surface from the front and continues for
    two truncations. Then a cell behind the surface loses half of its weight; once that cell is
    unknown, the surface in front of it is removed, too.
    """
    n_back = int(rule.truncation / field.cell) + 1
    u, v = (x - field.corner[0]) / field.cell, (y - field.corner[1]) / field.cell
    for k in range(count):
        r = math.hypot(lines[k, 0] - x, lines[k, 1] - y) + 1e-9
        dx, dy = (lines[k, 0] - x) / r, (lines[k, 1] - y) / r
        stride = k & -k if k > 0 else count  # near the laser every 2nd, 4th ... line is enough
        spacing = abs(rule.angle_increment) * lines[k, 5] / r
        first = int(1.0 / (2.0 * spacing * stride + 1e-9)) if stride < count else 0
        last = int(r / field.cell)
        for step in range(min(first, last), last):
            ix, iy = math.floor(u + step * dx), math.floor(v + step * dy)
            state = field.cell_state[iy, ix]
            if state == PASS_BITS:
                continue
            if state & PASS_BITS != PASS_BITS:
                field.cell_state[iy, ix] += 1
            if not state & BEHIND_BIT or r - step * field.cell < 2.0 * rule.truncation:
                continue
            layer = layer_of(-dx, -dy)
            if decay_cell(field, layer, iy, ix, 0.5, -field.cell):
                for s in range(max(step - n_back, 0), step + 1):
                    px, py = math.floor(u + s * dx), math.floor(v + s * dy)
                    decay_cell(field, layer, py, px, 0.0, math.inf)
