"""Kernel of correlative matching: the score of every pose of a window.

[Olson09] E. Olson: Real-Time Correlative Scan Matching. ICRA 2009.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats


@njit
def correlate(
    likelihood: NDArray[np.float32], frame: Floats, points: Floats, window: Floats, out: Floats
) -> None:
    """Best shift for each rotation of a window, by the mean likelihood at the end points [Olson09].

    ours: exhaustive over shifts of whole cells. likelihood (ny, nx); frame (3,): center of cell
    [0, 0] [m], cell [m]; points (2, n) [m] in the base frame. window (6,): x, y, theta of its
    middle, half width [cell], half number of rotations and their step [rad]. out (rotations, 4):
    x, y, theta, score.
    """
    height, width = likelihood.shape
    n = points.shape[1]
    cell, shifts, rotations = frame[2], int(window[3]), int(window[4])
    ex = (window[0] - frame[0]) / cell + 0.5
    ey = (window[1] - frame[1]) / cell + 0.5
    ix, iy = np.empty(n, np.int64), np.empty(n, np.int64)
    for row in range(2 * rotations + 1):
        theta = window[2] + (row - rotations) * window[5]
        c, s = math.cos(theta) / cell, math.sin(theta) / cell
        for i in range(n):
            ix[i] = math.floor(ex + c * points[0, i] - s * points[1, i])
            iy[i] = math.floor(ey + s * points[0, i] + c * points[1, i])
        out[row, 2], out[row, 3] = theta, -1.0
        for jy in range(-shifts, shifts + 1):
            for jx in range(-shifts, shifts + 1):
                total = 0.0
                for i in range(n):
                    u, v = ix[i] + jx, iy[i] + jy
                    if 0 <= u < width and 0 <= v < height:
                        total += likelihood[v, u]
                if total > out[row, 3] * n:
                    out[row, 0] = window[0] + jx * cell
                    out[row, 1] = window[1] + jy * cell
                    out[row, 3] = total / n
