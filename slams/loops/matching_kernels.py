"""Kernels that match a scan with the local map of a few keyframes.

[LuMilios97] F. Lu, E. Milios: Globally Consistent Range Scan Alignment for Environment Mapping.
Autonomous Robots 4, 1997.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats

Grid = NDArray[np.float32]
BESIDE = 0.6  # likelihood of a cell beside that of a wall


@njit
def paint(points: Floats, x0: float, y0: float, cell: float, out: Grid) -> None:
    """Likelihood of walls around end points (2, n) [m]: 1 in their cells, less beside. ours.

    x0, y0: center of cell [0, 0] [m]; out (ny, nx).
    """
    height, width = out.shape
    for i in range(points.shape[1]):
        ix = math.floor((points[0, i] - x0) / cell + 0.5)
        iy = math.floor((points[1, i] - y0) / cell + 0.5)
        if ix < 1 or iy < 1 or ix >= width - 1 or iy >= height - 1:
            continue
        for jy in range(iy - 1, iy + 2):
            for jx in range(ix - 1, ix + 2):
                out[jy, jx] = max(out[jy, jx], 1.0 if jx == ix and jy == iy else BESIDE)


@njit
def visible(
    points: Floats, pose: Floats, ranges: Grid, laser: Floats, tolerance: float, out: Floats
) -> None:
    """Whether another scan has seen each end point, or has seen through it [LuMilios97]. ours.

    points (2, n) [m] in their base; pose (3,) of that base in the frame of the other laser; ranges
    (m,) of the other scan; laser (3,): first angle, step [rad], greatest range [m]. A point between
    the ranges of the neighboring beams is an inlier: out (n,) becomes 1; where all of them went
    farther it is a conflict: out becomes -1 unless it is 1; a hidden point stays as it is.
    """
    m = len(ranges)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for i in range(points.shape[1]):
        x = pose[0] + c * points[0, i] - s * points[1, i]
        y = pose[1] + s * points[0, i] + c * points[1, i]
        r = math.sqrt(x * x + y * y)
        turn = math.atan2(y, x) - laser[0]
        if laser[1] > 0.0:
            turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi))
        else:
            turn -= 2.0 * math.pi * math.ceil(turn / (2.0 * math.pi))
        beam = int(turn / laser[1] + 0.5)
        if beam >= m:
            continue
        low, high = math.inf, -math.inf
        for k in range(max(beam - 1, 0), min(beam + 2, m)):
            if not math.isnan(ranges[k]):
                value = min(ranges[k], laser[2])
                low, high = min(low, value), max(high, value)
        near = tolerance + abs(laser[1]) * r
        if low < laser[2] and low - near <= r <= high + near:
            out[i] = 1.0
        elif high > 0.0 and r < low - near and out[i] != 1.0:
            out[i] = -1.0
