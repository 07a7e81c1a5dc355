"""Kernels of random restart hill climbing over a lattice of poses."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from crsm.original.map_kernels import BORDER_CELLS, UNKNOWN_VALUE
from slams.jit import njit

MAX_RAY_SCORE = 14  # weight 10 of the end cell and 1 of each of its four neighbors
MAX_GRAY_LEVEL = 255.0
NO_SCORE = -1  # table entry of a cell that adds nothing to the fitness
NOT_EVALUATED = np.float32(-1.0)  # fitness of a lattice pose that is not evaluated yet


@njit
def score_table(grid: Any, box: Any, out_table: Any) -> None:
    """[Tsardoulias13] fitness of one ray: 10 x darkness of a cell + that of its four neighbors.

    grid (ny, nx) uint8; box (x0, y0, x1, y1) cells; out_table (ny, nx) int16, filled in the box.
    """
    ny, nx = grid.shape
    for y in range(box[1], box[3]):
        for x in range(box[0], box[2]):
            out_table[y, x] = NO_SCORE
        if y <= BORDER_CELLS or y >= ny - BORDER_CELLS - 1:
            continue
        for x in range(max(box[0], BORDER_CELLS + 1), min(box[2], nx - BORDER_CELLS - 1)):
            v = np.int16(grid[y, x])
            around = np.int16(grid[y, x - 1]) + np.int16(grid[y, x + 1])
            around += np.int16(grid[y - 1, x]) + np.int16(grid[y + 1, x])
            score = MAX_RAY_SCORE * 255 - 10 * v - around
            out_table[y, x] = NO_SCORE if v == UNKNOWN_VALUE else score


@njit
def rotate(rays: Any, k: int, angle: Any, out: Any) -> None:
    """[Tsardoulias13] fitness: end cells (k, 2) rotated by angle [rad], all in float32."""
    c = np.float32(math.cos(float(angle)))
    s = np.float32(math.sin(float(angle)))
    for j in range(k):
        out[j, 0] = rays[j, 0] * c - rays[j, 1] * s
        out[j, 1] = rays[j, 0] * s + rays[j, 1] * c


@njit
def fitness(table: Any, rays: Any, k: int, shift: Any, best: Any) -> Any:
    """[Tsardoulias13] fitness of rotated rays (k, 2) at shift (x, y, origin x, origin y) cells.

    Exact if above `best`; otherwise the sum stops, with 0, as soon as it cannot reach `best`.
    """
    ny, nx = table.shape
    x, y, ox, oy = shift
    total = np.float32(0.0)
    goal = best * MAX_RAY_SCORE * k * (1.0 - 1e-4) - 1e-3  # below, by more than rounding errors
    for j in range(k):
        ix = int((rays[j, 0] + x) + ox)
        iy = int((rays[j, 1] + y) + oy)
        if 0 <= ix < nx and 0 <= iy < ny and table[iy, ix] != NO_SCORE:
            total = np.float32(total + table[iy, ix] / MAX_GRAY_LEVEL)
        if j % 8 == 7 and total + MAX_RAY_SCORE * (k - j - 1) < goal:
            return np.float32(0.0)
    return np.float32(total / (MAX_RAY_SCORE * float(k)))


@njit
def hill_climb(
    table: Any,
    rays: Any,
    k: int,
    start: Any,
    draws: Any,
    disparity: int,
    buffers: Any,
    out_step: Any,
) -> float:
    """[Tsardoulias13] random restart hill climbing over a lattice of steps; returns its fitness.

    start (x, y, theta, origin x, origin y) cells, rad; draws (n, 3) integers in [0, disparity);
    buffers: fitness per lattice pose, rotated rays per heading, rotated rays off the lattice;
    out_step (3,) cells, cells, rad. The fitness of a lattice pose is evaluated once per scan.
    """
    evaluated, rotated, off_lattice = buffers
    half, quarter, eighth = disparity // 2, disparity // 4, disparity // 8
    for a in range(disparity):
        angle = np.float32(start[2] + np.float32((a - half) / 45.0))
        rotate(rays, k, angle, rotated[a])
    evaluated[:] = NOT_EVALUATED
    best = np.float32(0.0)
    out_step[:] = 0.0
    dx, dy, dth = 0, 0, np.float32(0.0)
    a = half
    for n in range(draws.shape[0]):
        x, y = np.float32(start[0] + dx), np.float32(start[1] + dy)
        shift = (x, y, np.float32(start[3]), np.float32(start[4]))
        if a >= 0:
            score = evaluated[a, dy + quarter, dx + quarter]
            if score == NOT_EVALUATED:
                score = fitness(table, rotated[a], k, shift, best)
                evaluated[a, dy + quarter, dx + quarter] = score
        else:
            rotate(rays, k, np.float32(start[2] + dth), off_lattice)
            score = fitness(table, off_lattice, k, shift, best)
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
