"""The published program of 2016 in scalar loops: bytes 0 (wall) .. 127 (unknown) .. 255 (free)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slams.jit import njit

UNKNOWN = 127
BORDER = 50  # cells at the rim of the map that are neither scored nor drawn
FULL_SCORE = 14  # weight 10 of the end cell and 1 of each of its four neighbors
GREY_LEVELS = 255.0
NO_SCORE = -1  # table entry of a cell that adds nothing
NOT_YET = np.float32(-1.0)  # fitness of a lattice pose that was not evaluated


@njit
def clean(ranges: Any, directions: Any, limits: Any, out_d: Any, out_ends: Any) -> None:
    """[Tsardoulias13] code: ranges d (n,) [m] with 0 for no data, end cells (n, 2) cut to int.

    limits (least range [m], range_max [m], cell [m])
    """
    for i in range(ranges.shape[0]):
        r = ranges[i]
        out_d[i] = r if limits[0] <= r <= limits[1] else 0.0
        # towards the sensor's axes, as a C cast does
        out_ends[i, 0] = int(out_d[i] / limits[2] * directions[i, 0])
        out_ends[i, 1] = int(out_d[i] / limits[2] * directions[i, 1])


@njit
def range_changes(d: Any, jump: float, far: float, out_picked: Any) -> tuple[float, float]:
    """[Tsardoulias13] "big changes": marks (n,) both sides of range jumps and the scan's ends.

    jump, far [m]. Returns (mean difference of neighbors, longest range) [m].
    """
    n = d.shape[0]
    total, longest = 0.0, 0.0
    first, last = -1, -1
    for i in range(n):
        out_picked[i] = False
        longest = max(longest, d[i])
        if i + 1 < n:
            total += abs(d[i] - d[i + 1])
        if d[i] < far:
            first = i if first < 0 else first
            last = i
    i = 0
    while i < n - 1:
        step = 1
        if abs(d[i] - d[i + 1]) > jump:
            out_picked[i] = d[i] < far
            out_picked[i + 1] = d[i + 1] < far
            step = max(1, int(out_picked[i]) + int(out_picked[i + 1]))
        i += step
    if first >= 0:
        out_picked[first] = True
        out_picked[last] = True
    return total / max(n - 1, 1), longest


@njit
def picked_between(d: Any, level: float, far: float, longest: float, picked: Any) -> int:
    """[Tsardoulias13] controlled density: adds rays where the range has changed enough.

    picked (n,) marks the jumps on entry, the rays after; far, longest [m]. Returns the count.
    """
    n = d.shape[0]
    count = 0
    root = math.sqrt(longest)
    s = -1
    for e in range(n):
        if not picked[e]:
            continue
        if s >= 0 and d[s + 1] <= far:
            step = 0.0
            for i in range(s, e - 1):
                step += abs(d[i] - d[i + 1])
            step /= e - s
            collected = 0.0
            for i in range(s, e):
                collected += abs(d[i] - d[i + 1])
                if collected > level * step / math.exp(3.0 * d[i] / root):
                    picked[i] = True
                    count += 1
                    collected = 0.0
        s = e
    return count


@njit
def fill_gaps(gap: int, picked: Any) -> None:
    """[Tsardoulias13] gap filling: halves every gap of more than `gap` rays until none is left."""
    n = picked.shape[0]
    s = -1
    for e in range(n):
        if not picked[e]:
            continue
        if s >= 0:
            _halve(s, e, gap, picked)
        s = e


@njit
def _halve(s: int, e: int, gap: int, picked: Any) -> None:
    """[Tsardoulias13] gap filling of one gap between the rays s and e."""
    todo = np.empty((64, 2), np.int64)
    todo[0, 0], todo[0, 1] = s, e
    k = 1
    while k > 0:
        k -= 1
        a, b = todo[k, 0], todo[k, 1]
        if b - a > gap:
            half = (a + b) // 2
            picked[half] = True
            todo[k, 0], todo[k, 1] = a, half
            todo[k + 1, 0], todo[k + 1, 1] = half, b
            k += 2


@njit
def selected(d: Any, longest_valid: float, picked: Any, ends: Any, out_ends: Any) -> int:
    """[Tsardoulias13] code: end cells (k, 2) float32 of the marked rays that hit; returns k."""
    k = 0
    for i in range(d.shape[0]):
        if picked[i] and d[i] != 0.0 and d[i] != longest_valid:
            out_ends[k, 0] = ends[i, 0]
            out_ends[k, 1] = ends[i, 1]
            k += 1
    return k


@njit
def score_table(grid: Any, box: Any, out_table: Any) -> None:
    """[Tsardoulias13] fitness, the part of one ray: 10 x darkness of a cell + its four neighbors.

    grid (ny, nx) uint8; box (x0, y0, x1, y1) cells; out_table (ny, nx) int16, filled in the box.
    """
    ny, nx = grid.shape
    for y in range(box[1], box[3]):
        for x in range(box[0], box[2]):
            out_table[y, x] = NO_SCORE
        if y <= BORDER or y >= ny - BORDER - 1:
            continue
        for x in range(max(box[0], BORDER + 1), min(box[2], nx - BORDER - 1)):
            v = np.int16(grid[y, x])
            around = np.int16(grid[y, x - 1]) + np.int16(grid[y, x + 1])
            around += np.int16(grid[y - 1, x]) + np.int16(grid[y + 1, x])
            score = FULL_SCORE * 255 - 10 * v - around
            out_table[y, x] = NO_SCORE if v == UNKNOWN else score


@njit
def turned(rays: Any, k: int, angle: Any, out_turned: Any) -> None:
    """[Tsardoulias13] fitness: end cells (k, 2) turned by angle [rad], in float32 throughout."""
    c = np.float32(math.cos(float(angle)))
    s = np.float32(math.sin(float(angle)))
    for j in range(k):
        out_turned[j, 0] = rays[j, 0] * c - rays[j, 1] * s
        out_turned[j, 1] = rays[j, 0] * s + rays[j, 1] * c


@njit
def fitness(table: Any, rays: Any, k: int, shift: Any, best: Any) -> Any:
    """[Tsardoulias13] fitness of turned rays (k, 2) at shift (x, y, origin x, origin y) cells.

    Exact if above `best`; else possibly 0, as soon as `best` is out of reach.
    """
    ny, nx = table.shape
    x, y, ox, oy = shift
    total = np.float32(0.0)
    goal = best * FULL_SCORE * k * (1.0 - 1e-4) - 1e-3  # less, by more than rounding can do
    for j in range(k):
        ix = int((rays[j, 0] + x) + ox)
        iy = int((rays[j, 1] + y) + oy)
        if 0 <= ix < nx and 0 <= iy < ny and table[iy, ix] != NO_SCORE:
            total = np.float32(total + table[iy, ix] / GREY_LEVELS)
        if j % 8 == 7 and total + FULL_SCORE * (k - j - 1) < goal:
            return np.float32(0.0)
    return np.float32(total / (FULL_SCORE * float(k)))


@njit
def hill_climb(
    table: Any,
    rays: Any,
    k: int,
    start: Any,
    draws: Any,
    disparity: int,
    memory: Any,
    out_step: Any,
) -> float:
    """[Tsardoulias13] random restart hill climbing over a lattice of steps; returns its fitness.

    start (x, y, theta, origin x, origin y) cells, rad; draws (n, 3) integers in [0, disparity);
    memory: fitness per lattice pose, turned rays per heading, scratch rays;
    out_step (3,) cells, cells, rad. Poses met before in this scan are remembered.
    """
    seen, fan, scratch = memory
    half, quarter, eighth = disparity // 2, disparity // 4, disparity // 8
    fan_angle = np.float32(-1e9)
    for a in range(disparity):
        angle = np.float32(start[2] + np.float32((a - half) / 45.0))
        turned(rays, k, angle, fan[a])
    seen[:] = NOT_YET
    best = np.float32(0.0)
    out_step[:] = 0.0
    dx, dy, dth = 0, 0, np.float32(0.0)
    a = half
    for n in range(draws.shape[0]):
        x, y = np.float32(start[0] + dx), np.float32(start[1] + dy)
        shift = (x, y, np.float32(start[3]), np.float32(start[4]))
        if a >= 0:
            score = seen[a, dy + quarter, dx + quarter]
            if score == NOT_YET:
                score = fitness(table, fan[a], k, shift, best)
                seen[a, dy + quarter, dx + quarter] = score
        else:
            fan_angle = np.float32(start[2] + dth)
            turned(rays, k, fan_angle, scratch)
            score = fitness(table, scratch, k, shift, best)
        u, v, w = int(draws[n, 0]), int(draws[n, 1]), int(draws[n, 2])
        if score > best:
            best = score
            out_step[0], out_step[1], out_step[2] = dx, dy, dth
            dx += u // 4 - eighth
            dy += v // 4 - eighth
            dth = np.float32(dth + (w - half) / 90.0)
            a = -1
        else:
            dx = u // 2 - quarter
            dy = v // 2 - quarter
            dth = np.float32((w - half) / 45.0)
            a = w
    return float(best)


@njit
def reach(d: Any, directions: Any, pose: Any, shape: Any, cell: float, out_grow: Any) -> None:
    """[Tsardoulias13] code: cells to add (left, right, low, high) so that every end point fits.

    d (n,) [m]; directions (n, 2) in the map; pose (x, y) cells from the corner; shape (ny, nx).
    """
    out_grow[:] = 0
    for i in range(d.shape[0]):
        for axis in range(2):
            size = shape[1 - axis]
            at = d[i] / cell * directions[i, axis] + pose[axis] + 3.0
            if at < BORDER and abs(at) > out_grow[2 * axis]:
                out_grow[2 * axis] = int(abs(at) + 100.0)
            if at >= size - BORDER and abs(at - size) > out_grow[2 * axis + 1]:
                out_grow[2 * axis + 1] = int(abs(at - size) + 100.0)


@njit
def intensity_tables(gain: Any, out_tables: Any) -> None:
    """[Tsardoulias13] code: new value of a byte after free, hit, and free then hit; (3, 256).

    gain (free, hit) grey levels. The step shrinks towards black and white; the value is cut to int.
    """
    for v in range(256):
        q = 1.0 - math.sqrt(abs(v - UNKNOWN) / 128.0)
        free = int(v + q * gain[0])
        out_tables[0, v] = min(255, free)
        out_tables[1, v] = max(0, int(v - q * gain[1]))
        out_tables[2, v] = max(0, int(free - q * gain[1]))


@njit
def is_repeated(ends: Any, d: Any, i: int, increment: float) -> bool:
    """[Tsardoulias13] code: an earlier beam of the scan ends in the same cell."""
    radius = math.hypot(ends[i, 0], ends[i, 1])
    # end points in one cell, twice as wide on the axes, are no further apart than this
    near = int(3.0 / max(radius, 1.0) / abs(increment)) + 1
    for j in range(max(0, i - near), i):
        if d[j] != 0.0 and ends[j, 0] == ends[i, 0] and ends[j, 1] == ends[i, 1]:
            return True
    return False


@njit
def draw(
    d: Any,
    ends: Any,
    directions: Any,
    increment: float,
    pose: Any,
    cell: float,
    tables: Any,
    out: Any,
) -> None:
    """[Tsardoulias13] code, map update: every beam whitens its way and blackens its last two cells.

    d (n,) [m]; directions (n, 2) in the map; pose (x, y) cells from the corner; out (ny, nx) uint8.
    """
    ny, nx = out.shape
    first = True
    for i in range(d.shape[0]):
        if d[i] == 0.0 or is_repeated(ends, d, i, increment):
            continue
        length = int(d[i] / cell)
        for r in range(0 if first else 1, length + 1):
            ix = int(r * directions[i, 0] + pose[0])
            iy = int(r * directions[i, 1] + pose[1])
            if ix < BORDER or iy < BORDER or ix >= nx - BORDER or iy >= ny - BORDER:
                break
            kind = 0 if r < length - 1 else (2 if r < length else 1)
            out[iy, ix] = tables[kind, out[iy, ix]]
        first = False
