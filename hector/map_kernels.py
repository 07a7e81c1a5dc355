"""Kernels of the occupancy pyramid: map update.

Coordinates of a level are real numbers in cells, and the integer i is the CENTER of cell i:
cell = (world - first) / resolution, with `first` the center of cell [0, 0].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.scan.scan_kernels import Points
from slams.types import Pose2

FREE_LOG_ODDS = -1.1  # 1; a cell below is free: p < 0.25, observed by three scans
NEGLIGIBLE_P_LOG_ODDS = -10.0  # 1; below, p stays as it is, at most 5e-5


class Level(NamedTuple):
    """One grid of the pyramid; arrays are indexed [iy, ix].

    `log_odds` is 0 where nothing was observed; `p` the probability that the matcher reads; `stamp`
    twice the number of the last scan that changed a cell, plus 1 if a beam ended in it; x0, y0 [m]
    the center of cell [0, 0]; `resolution` the edge of a cell [m].
    """

    log_odds: NDArray[np.float32]
    p: NDArray[np.float32]
    stamp: NDArray[np.int32]
    x0: float
    y0: float
    resolution: float


class Update(NamedTuple):
    """Log-odds added to free and to occupied cells; above the `ceiling` nothing is added."""

    free: float
    occupied: float
    ceiling: float


@njit(inner=True, borrows=True)
def mark_free(level: Level, u: np.uint64, v: np.uint64, mark: int, update: Update) -> None:
    """Update cell [v, u] as free, once per scan: inverse sensor model, [Kohlbrecher11] sec. IV-A.

    ours: where `p` is almost 0, as in most cells of a beam, it stays as it is.
    """
    if level.stamp[v, u] < mark:
        log_odds = level.log_odds[v, u] + update.free
        level.log_odds[v, u], level.stamp[v, u] = log_odds, mark
        if log_odds > NEGLIGIBLE_P_LOG_ODDS:
            level.p[v, u] = probability(log_odds)


@njit(inner=True, borrows=True)
def mark_occupied(level: Level, u: np.uint64, v: np.uint64, mark: int, update: Update) -> None:
    """Update cell [v, u] as occupied, once per scan: [Kohlbrecher11] sec. IV-A.

    The free update of the same scan is undone.
    """
    if level.stamp[v, u] > mark:
        return
    if level.stamp[v, u] == mark:
        level.log_odds[v, u] -= update.free
    if level.log_odds[v, u] < update.ceiling:
        level.log_odds[v, u] += update.occupied
    level.stamp[v, u] = mark + 1
    level.p[v, u] = probability(level.log_odds[v, u])


@njit(inner=True, borrows=True)
def probability(log_odds: float) -> float:
    """Probability for the matcher, p = e^l / (1 + e^l); ours: 0 where nothing was observed."""
    if log_odds == 0.0:
        return 0.0
    return 1.0 / (1.0 + math.exp(-log_odds))


@njit
def insert(
    level: Level,
    points: Points,
    n: int,
    pose: Pose2,
    mount: Pose2,
    number: int,
    update: Update,
) -> None:
    """Update one level with a scan: free along each beam, occupied at its end point.

    [Kohlbrecher11] sec. IV-A: Bresenham lines from the sensor's cell to the cell of the end point,
    which stays occupied if another beam passes it. points (2, >= n) [m] in the base frame; `number`
    counts the insertions from 1. A beam that leaves the grid is skipped.
    """
    height, width = level.p.shape
    mark = 2 * number
    scale = 1.0 / level.resolution
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    ax = math.floor((pose.x + c * mount.x - s * mount.y - level.x0) * scale + 0.5)
    ay = math.floor((pose.y + s * mount.x + c * mount.y - level.y0) * scale + 0.5)
    if not (0 <= ax < width and 0 <= ay < height):
        return
    last_x, last_y = ax, ay
    for i in range(n):
        x, y = points[0, i], points[1, i]
        bx = math.floor((pose.x + c * x - s * y - level.x0) * scale + 0.5)
        by = math.floor((pose.y + s * x + c * y - level.y0) * scale + 0.5)
        if bx == last_x and by == last_y:
            continue  # the same line of cells as that of the beam before
        last_x, last_y = bx, by
        if (bx == ax and by == ay) or not (0 <= bx < width and 0 <= by < height):
            continue
        dx, dy = abs(bx - ax), abs(by - ay)
        sx, sy = (1 if bx > ax else -1), (1 if by > ay else -1)
        steep = dy > dx
        major, minor = (dy, dx) if steep else (dx, dy)
        ix, iy, error = ax, ay, major // 2
        for _ in range(major):
            mark_free(level, np.uint64(ix), np.uint64(iy), mark, update)
            error += minor
            diagonal = error >= major
            if diagonal:
                error -= major
            ix += sx if diagonal or not steep else 0
            iy += sy if diagonal or steep else 0
        mark_occupied(level, np.uint64(bx), np.uint64(by), mark, update)
