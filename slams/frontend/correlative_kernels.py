"""Kernels of correlative matching in two resolutions.

[Olson15] E. Olson: M3RSM: Many-to-Many Multi-Resolution Scan Matching. ICRA 2015.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats

Grid = NDArray[np.float32]


@njit
def pool(fine: Grid, block: int, out: Grid) -> None:
    """The largest likelihood that a point can meet in a block or up to one further on [Olson15].

    out[j, i] bounds fine[j block + v, i block + u] for u, v from 0 to 2 block - 1: a point anywhere
    in the block, shifted by less than a block.
    """
    height, width = fine.shape
    for iy in range(height):
        for ix in range(width):
            value = fine[iy, ix]
            if value > 0.0:
                v, u = iy // block, ix // block
                for jy in range(max(v - 1, 0), v + 1):
                    for jx in range(max(u - 1, 0), u + 1):
                        if out[jy, jx] < value:
                            out[jy, jx] = value


@njit
def bounds(coarse: Grid, points: Floats, window: Floats, frame: Floats, out: Grid) -> None:
    """Bound of the mean likelihood for every rotation and coarse shift of a window [Olson15].

    points (2, n) [m]; window (6,): x, y [m], theta [rad] of its first pose, step of rotations
    [rad], block [m], and the score below which a pose is given up; frame (2,): corner of the coarse
    cell [0, 0] [m]. out (rotations, ny, nx).
    """
    height, width = np.uint64(coarse.shape[0]), np.uint64(coarse.shape[1])
    n, block = points.shape[1], window[4]
    missing = (1.0 - window[5]) * n
    ix, iy = np.empty(n, np.int64), np.empty(n, np.int64)
    for k in range(out.shape[0]):
        theta = window[2] + k * window[3]
        c, s = math.cos(theta), math.sin(theta)
        for i in range(n):
            ix[i] = math.floor((window[0] + c * points[0, i] - s * points[1, i] - frame[0]) / block)
            iy[i] = math.floor((window[1] + s * points[0, i] + c * points[1, i] - frame[1]) / block)
        for jy in range(out.shape[1]):
            for jx in range(out.shape[2]):
                total = 0.0
                for i in range(n):
                    u, v = np.uint64(ix[i] + jx), np.uint64(iy[i] + jy)  # below 0: huge
                    if u < width and v < height:
                        total += coarse[v, u]
                    if i - total > missing:
                        break
                out[k, jy, jx] = total / n


@njit
def finest(
    fine: Grid, points: Floats, frame: Floats, block: int, enough: Floats, poses: Floats
) -> None:
    """Best shift within a block for each of several poses, by the mean likelihood [Olson15].

    What can't come close to the best score so far is given up. fine (ny, nx); points (2, n) [m];
    frame (3,): center of cell [0, 0], cell [m]; enough (2,): a score that the best must have, and
    how much below the best a score still counts; poses (k, 4): x, y, theta of the least shift and
    the bound, the greatest first; the best shift and its score, too low where it was given up, are
    written there.
    """
    height, width = np.uint64(fine.shape[0]), np.uint64(fine.shape[1])
    n, cell = points.shape[1], frame[2]
    ix, iy = np.empty(n, np.int64), np.empty(n, np.int64)
    top, alike = enough[0], enough[1]
    for k in range(poses.shape[0]):
        if poses[k, 3] < top - alike:
            poses[k, 3] = 0.0
            continue
        x, y, c, s = poses[k, 0], poses[k, 1], math.cos(poses[k, 2]), math.sin(poses[k, 2])
        for i in range(n):
            ix[i] = math.floor((x + c * points[0, i] - s * points[1, i] - frame[0]) / cell + 0.5)
            iy[i] = math.floor((y + s * points[0, i] + c * points[1, i] - frame[1]) / cell + 0.5)
        best, missing = 0.0, (1.0 - top + alike) * n
        for jy in range(block):
            for jx in range(block):
                total = 0.0
                for i in range(n):
                    u, v = np.uint64(ix[i] + jx), np.uint64(iy[i] + jy)  # below 0: huge
                    if u < width and v < height:
                        total += fine[v, u]
                    if i - total > missing:
                        break
                if total > best:
                    best = total
                    poses[k, 0], poses[k, 1] = x + jx * cell, y + jy * cell
        poses[k, 3] = best / n
        top = max(top, poses[k, 3])
