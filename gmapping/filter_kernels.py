"""Weights, resampling, and the picture of one particle's history."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gmapping.tile_kernels import cell_of
from slams.jit import njit
from slams.types import Floats


@njit
def normalize(log_w: Floats, temper: float, out: Floats) -> float:
    """Weights that sum to 1 from log weights over `temper`; returns n_eff = 1 / sum w^2.

    [Grisetti07] eq. 20. log_w, out (particles,).
    """
    greatest, total, squares = -math.inf, 0.0, 0.0
    for i in range(log_w.shape[0]):
        greatest = max(greatest, log_w[i])
    for i in range(log_w.shape[0]):
        out[i] = math.exp((log_w[i] - greatest) / temper)
        total += out[i]
    for i in range(log_w.shape[0]):
        out[i] /= total
        squares += out[i] * out[i]
    return 1.0 / squares


@njit
def systematic(w: Floats, u: float, out: NDArray[np.int64]) -> None:
    """Ancestors by systematic resampling with one draw u in [0, 1): N w offspring on average.

    [Grisetti07] sec. II, original code. w (particles,) sums to 1; out (particles,).
    """
    n = w.shape[0]
    target, total, k = u / n, 0.0, 0
    last = 0
    for i in range(n):
        total += w[i]
        if w[i] > 0.0:
            last = i
        while k < n and total > target:
            out[k] = i
            k += 1
            target = (u + k) / n
    while k < n:  # rounding left the sum below 1
        out[k] = last
        k += 1


@njit
def draw(
    points: Floats,
    sensor: Floats,
    resolution: float,
    corner: NDArray[np.int64],
    hits: NDArray[np.int32],
    visits: NDArray[np.int32],
) -> None:
    """Count for every cell how often a beam ended in it and how often one came by.

    [Grisetti07] sec. II, original code, map of the best particle; Bresenham's line.
    points (n, 2), sensor (2,) m in the map; corner (2,) ix, iy of hits[0, 0]; counts (ny, nx).
    """
    sx, sy = cell_of(sensor[0], resolution) - corner[0], cell_of(sensor[1], resolution) - corner[1]
    height, width = visits.shape
    for i in range(points.shape[0]):
        ex = cell_of(points[i, 0], resolution) - corner[0]
        ey = cell_of(points[i, 1], resolution) - corner[1]
        x, y = sx, sy
        dx, dy = abs(ex - sx), abs(ey - sy)
        step_x, step_y = (1 if ex > sx else -1), (1 if ey > sy else -1)
        error = dx - dy
        while x != ex or y != ey:
            if 0 <= x < width and 0 <= y < height:
                visits[y, x] += 1
            twice = 2 * error
            if twice > -dy:
                error -= dy
                x += step_x
            if twice < dx:
                error += dx
                y += step_y
        if 0 <= x < width and 0 <= y < height:
            visits[y, x] += 1
            hits[y, x] += 1
