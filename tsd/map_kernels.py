"""The directional TSD field: four layers of tiles, one per facing of a surface."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import FAST, njit
from slams.types import Floats
from tsd.scan_kernels import Beams

SHIFT = 3
SIDE, INSIDE = 1 << SHIFT, (1 << SHIFT) - 1  # cells per tile edge; bits of a cell's number in it
WALL = SIDE // 2  # cells per edge of a cell of `walls`
LAYERS = 4  # facings: +x, +y, -x, -y
SHARED = 0.55  # a surface is written to every layer whose axis is within 57 degrees of its normal
PASSED, BEHIND = 3, 4  # of `seen`: how many beams passed the cell, up to three; behind a surface

# Kernels of a cell are FAST so that they are inlined: a call that hands over a Field, fifty words,
# takes longer than reading it.


class Field(NamedTuple):
    """Tiles of signed distances in four layers (surfaces facing +x, +y, -x, -y).

    `slots` (ny, nx, 4) gives each tile's place in the pool; 0 is a tile that is unknown everywhere,
    for all that are not there. `tsd` [m] (n, SIDE, SIDE) is nan where unknown. `corner` (2,) [m]
    is the outer corner of tile [0, 0]. `used` (1,) counts slots taken. `seen` (ny SIDE, nx SIDE)
    counts up to PASSED beams in two bits, with the bit BEHIND. `walls` (ny SIDE / WALL,
    nx SIDE / WALL): how close the nearest surface came to a cell's center, 1 for zero, 0 for a
    truncation.
    """

    slots: NDArray[np.int32]
    tsd: NDArray[np.float32]
    weight: NDArray[np.float32]
    corner: Floats
    cell: float
    used: NDArray[np.int64]
    seen: NDArray[np.uint8]
    walls: NDArray[np.float32]


class PushRule(NamedTuple):
    """How a scan enters the field: truncation [m], weight cap, angle between beams [rad]."""

    truncation: float
    max_weight: float
    gap: float


@njit(fastmath=FAST, inner=True)
def facing(nx: float, ny: float) -> int:
    """Layer of a surface with this normal: 0 +x, 1 +y, 2 -x, 3 -y. ours."""
    if abs(nx) >= abs(ny):
        return 0 if nx >= 0.0 else 2
    return 1 if ny >= 0.0 else 3


@njit(fastmath=FAST, inner=True)
def next_facing(nx: float, ny: float) -> int:
    """Layer of the second nearest axis to this normal, beside that of `facing`. ours."""
    if abs(nx) >= abs(ny):
        return 1 if ny >= 0.0 else 3
    return 0 if nx >= 0.0 else 2


@njit(fastmath=FAST, inner=True, borrows=True)
def slot_of(field: Field, layer: int, iy: int, ix: int) -> int:
    """Place in the pool of the tile that a cell lies in, 0 where there is none. ours."""
    ty, tx = iy >> SHIFT, ix >> SHIFT
    if ty < 0 or tx < 0 or ty >= field.slots.shape[0] or tx >= field.slots.shape[1]:
        return 0
    return int(field.slots[ty, tx, layer])


@njit(fastmath=FAST, inner=True, borrows=True)
def cell_value(field: Field, layer: int, iy: int, ix: int) -> float:
    """Signed distance [m] in one cell, nan where unknown or outside. ours."""
    return float(field.tsd[slot_of(field, layer, iy, ix), iy & INSIDE, ix & INSIDE])


@njit(fastmath=FAST, inner=True, borrows=True)
def seen_at(field: Field, x: float, y: float) -> int:
    """What `seen` says of the cell at a point, 0 outside. ours."""
    ix = math.floor((x - field.corner[0]) / field.cell)
    iy = math.floor((y - field.corner[1]) / field.cell)
    inside = 0 <= iy < field.seen.shape[0] and 0 <= ix < field.seen.shape[1]
    return int(field.seen[iy, ix]) if inside else 0


@njit(fastmath=FAST, inner=True, borrows=True)
def read_field(field: Field, layer: int, x: float, y: float) -> tuple[float, float, float]:
    """Bilinear signed distance [m] and its gradient at a point; nan next to unknown cells.

    [May14] interpolation between the four surrounding cell centers; ours: the gradient is that
    of the interpolant, so that Gauss-Newton descends what it sums.
    """
    scale = 1.0 / field.cell
    u = (x - field.corner[0]) * scale - 0.5
    v = (y - field.corner[1]) * scale - 0.5
    ix, iy = math.floor(u), math.floor(v)
    wx, wy = u - ix, v - iy
    slot, jx, jy = slot_of(field, layer, iy, ix), ix & INSIDE, iy & INSIDE
    if jx < INSIDE and jy < INSIDE:
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
    """Surface elements in the map. ours: what is pushed are lines, not the ends of beams.

    surfaces (n, 8) as made by `fit_surfaces`; firsts (n + 1,) the first hit of each one's surface;
    pose (3,) of the base. out_lines (n, 7): x, y [m], normal x, y, cosine of incidence, distance
    [m] times the beams that it stands for, 1 where the surface goes on to the next element. Returns
    their bounding box x, y, x, y [m].
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
    """Rows of cells that cross a line, up to halfway to its neighbors, for each layer it faces.

    ours: only the cells beside surfaces are visited. lines (n, 7) as made by `place_lines`;
    layers 0 and 2 go by rows, 1 and 3 by columns. out_rows (m, 4): line, layer, number of the
    row, where the line crosses it [m from the corner]. Returns how many.
    """
    n_rows = 0
    turn = math.copysign(1.0, rule.gap)
    for k in range(count):
        reach = min(0.5 * lines[k, 5] * abs(rule.gap) / lines[k, 4], 0.5)
        for across in range(2):
            along = 1 - across
            nu, nv = lines[k, 2 + along], lines[k, 2 + across]
            if abs(nv) < SHARED:
                continue
            layer = across if nv > 0.0 else across + 2
            u = lines[k, along] - field.corner[along]
            ahead = reach * turn * nv * (2 * across - 1)
            before, after = u - ahead, u + ahead
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
def begin_tile(field: Field) -> int:
    """A tile of the pool that is unknown everywhere; 0 where all are taken. ours."""
    slot = field.used[0]
    if slot >= field.tsd.shape[0]:
        return 0
    for j in range(SIDE):
        for i in range(SIDE):
            field.tsd[slot, j, i] = math.nan
    field.used[0] += 1
    return int(slot)


@njit
def push_rows(field: Field, lines: Floats, rows: Floats, n_rows: int, rule: PushRule) -> None:
    """Push: every cell of the rows takes its distance to the line, a running weighted mean.

    [May14] update of tsd and weight; ours: distance to the local line instead of along the ray,
    each surface in the layers it faces, less weight behind it, where no beam has been.
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
            ty, tx = iy >> SHIFT, ix >> SHIFT
            if iy < 0 or ix < 0 or ty >= field.slots.shape[0] or tx >= field.slots.shape[1]:
                continue
            slot = field.slots[ty, tx, layer]
            if slot == 0:
                slot = begin_tile(field)
                if slot == 0:
                    continue
                field.slots[ty, tx, layer] = slot
            jy, jx = iy & INSIDE, ix & INSIDE
            sd = ((i + 0.5) * cell - v) * nv
            weight = lines[k, 4] * max(min(1.0 + sd / tau, 1.0), 0.01)
            old = field.weight[slot, jy, jx]
            mean = field.tsd[slot, jy, jx] if old > 0.0 else 0.0
            field.tsd[slot, jy, jx] = mean + (sd - mean) * weight / (old + weight)
            field.weight[slot, jy, jx] = min(old + weight, rule.max_weight)
            if sd < -cell:
                field.seen[iy, ix] |= BEHIND
            near = 1.0 - abs(sd) / tau
            if near > field.walls[iy // WALL, ix // WALL]:
                field.walls[iy // WALL, ix // WALL] = near


@njit(fastmath=FAST, inner=True)
def forget(field: Field, layer: int, iy: int, ix: int, share: float, limit: float) -> bool:
    """Leave a cell below `limit` [m] a share of its weight; true when it was its last. ours."""
    ty, tx = iy >> SHIFT, ix >> SHIFT
    slot, j, i = field.slots[ty, tx, layer], iy & INSIDE, ix & INSIDE
    if slot == 0 or not field.tsd[slot, j, i] < limit:
        return False
    field.weight[slot, j, i] *= share
    if field.weight[slot, j, i] >= 0.5:
        return False
    field.tsd[slot, j, i] = math.nan
    field.weight[slot, j, i] = 0.0
    return True


@njit
def carve(field: Field, lines: Floats, count: int, x: float, y: float, rule: PushRule) -> None:
    """Note the cells that beams from the laser at x, y passed, and forget walls they crossed.

    ours: free space costs one beam per cell, not one update per cell; only a beam that crosses a
    surface from its front and goes on for two truncations contradicts it. A cell behind
    the surface loses half its weight, and with its last the surface in front of it goes too.
    """
    back = int(rule.truncation / field.cell) + 1
    u, v = (x - field.corner[0]) / field.cell, (y - field.corner[1]) / field.cell
    for k in range(count):
        r = math.hypot(lines[k, 0] - x, lines[k, 1] - y) + 1e-9
        dx, dy = (lines[k, 0] - x) / r, (lines[k, 1] - y) / r
        shared = k & -k if k > 0 else count  # close by, every second, fourth ... line is enough
        apart = abs(rule.gap) * lines[k, 5] / r
        first = int(1.0 / (2.0 * apart * shared + 1e-9)) if shared < count else 0
        last = int(r / field.cell)
        for step in range(min(first, last), last):
            ix, iy = math.floor(u + step * dx), math.floor(v + step * dy)
            if field.seen[iy, ix] == PASSED:
                continue
            if field.seen[iy, ix] & PASSED != PASSED:
                field.seen[iy, ix] += 1
            if not field.seen[iy, ix] & BEHIND or r - step * field.cell < 2.0 * rule.truncation:
                continue
            layer = facing(-dx, -dy)
            if forget(field, layer, iy, ix, 0.5, -field.cell):
                for s in range(max(step - back, 0), step + 1):
                    px, py = math.floor(u + s * dx), math.floor(v + s * dy)
                    forget(field, layer, py, px, 0.0, math.inf)
