"""Kernels of correlative matching in two resolutions.

[Olson15] E. Olson: M3RSM: Many-to-Many Multi-Resolution Scan Matching. ICRA 2015.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats, Pose2

Grid = NDArray[np.float32]
Cells = NDArray[np.int64]


@njit(inner=True, borrows=True)
def cells_of(points: Floats, pose: Pose2, corner: Floats, cell: float, out: Cells) -> None:
    """Cells (2, n) of points (2, n) [m] at a pose; corner (2,) [m] of cell [0, 0]. ours."""
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    for i in range(points.shape[1]):
        x = pose.x + c * points[0, i] - s * points[1, i]
        y = pose.y + s * points[0, i] + c * points[1, i]
        out[0, i] = math.floor((x - corner[0]) / cell)
        out[1, i] = math.floor((y - corner[1]) / cell)


@njit(inner=True, borrows=True)
def sum_at(grid: Grid, cells: Cells, jx: int, jy: int, max_missing: float) -> float:
    """Sum of the likelihood at cells (2, n) shifted by jx, jy [Olson15].

    It stops early, with a sum that is too small, once more than `max_missing` of the n is missing.
    """
    height, width = np.uint64(grid.shape[0]), np.uint64(grid.shape[1])
    total = 0.0
    for i in range(cells.shape[1]):
        u, v = np.uint64(cells[0, i] + jx), np.uint64(cells[1, i] + jy)  # below 0: huge
        if u < width and v < height:
            total += grid[v, u]
        if i - total > max_missing:
            break
    return total


@njit
def bounds(
    coarse: Grid, points: Floats, window: Floats, frame: Floats, stride: int, out: Grid
) -> None:
    """Bound of the mean likelihood for every rotation and coarse shift of a window [Olson15].

    points (2, n) [m]; window (5,): x, y [m], theta [rad] of its first pose, step between rotations
    [rad], and the least score of interest; frame (3,): corner of cell [0, 0] and cell [m]; stride:
    cells of a coarse shift. out (rotations, ny, nx).
    """
    n = points.shape[1]
    max_missing = (1.0 - window[4]) * n
    cells = np.empty((2, n), np.int64)
    for k in range(out.shape[0]):
        pose = Pose2(window[0], window[1], window[2] + k * window[3])
        cells_of(points, pose, frame, frame[2], cells)
        for jy in range(out.shape[1]):
            for jx in range(out.shape[2]):
                out[k, jy, jx] = sum_at(coarse, cells, jx * stride, jy * stride, max_missing) / n


@njit
def best_shifts(
    fine: Grid, points: Floats, frame: Floats, block: int, scores: Floats, poses: Floats
) -> None:
    """Best shift within a block for each of several poses, by the mean likelihood [Olson15].

    fine (ny, nx); points (2, n) [m]; frame (3,): corner of cell [0, 0] and cell [m]; scores (2,):
    least score of the best pose, and the difference to the best score up to which scores are exact.
    poses (k, 4), sorted by falling bound: x, y, theta of the least shift, and the bound. The best
    shift and its score replace them; a score below the tolerance may be too small or 0.
    """
    n, cell = points.shape[1], frame[2]
    cells = np.empty((2, n), np.int64)
    top, tolerance = scores[0], scores[1]
    for k in range(poses.shape[0]):
        if poses[k, 3] < top - tolerance:
            poses[k, 3] = 0.0
            continue
        pose = Pose2(poses[k, 0], poses[k, 1], poses[k, 2])
        cells_of(points, pose, frame, cell, cells)
        best, max_missing = 0.0, (1.0 - top + tolerance) * n
        for jy in range(block):
            for jx in range(block):
                total = sum_at(fine, cells, jx, jy, max_missing)
                if total > best:
                    best = total
                    poses[k, 0], poses[k, 1] = pose.x + jx * cell, pose.y + jy * cell
        poses[k, 3] = best / n
        top = max(top, poses[k, 3])
