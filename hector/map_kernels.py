"""Kernels of the occupancy pyramid: map update.

Coordinates of a level are real numbers in cells; the integer i is the CENTER of cell i, so that
map = (world - first) / resolution with `first` the center of cell [0, 0].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.scan.scan_kernels import Points
from slams.types import Pose2

FREE = -1.1  # log-odds of a cell that three scans saw free: p < 0.25
SURELY_FREE = -10.0  # log-odds; p there is 5e-5


class Level(NamedTuple):
    """One grid of the pyramid; arrays are indexed [iy, ix].

    `log_odds` 0 = never observed; `p` its probability as the matcher reads it; `stamp` the last
    scan that touched a cell, times 2, plus 1 where it was hit; x0, y0 [m] the center of cell
    [0, 0]; `resolution` [m].
    """

    log_odds: NDArray[np.float32]
    p: NDArray[np.float32]
    stamp: NDArray[np.int32]
    x0: float
    y0: float
    resolution: float


class Update(NamedTuple):
    """Log-odds added to free and to occupied cells, the ceiling above which none is added.

    `odds` that a cell is occupied are multiplied by where it is seen free, the exponential of
    `free`.
    """

    free: float
    occupied: float
    ceiling: float
    odds: float


@njit(inner=True, borrows=True)
def mark_free(level: Level, u: np.uint64, v: np.uint64, mark: int, update: Update) -> None:
    """A beam passed cell [v, u], once per scan: inverse sensor model, [Kohlbrecher11] sec. IV-A.

    ours: `p` follows by Bayes' rule, as an exponential for each of so many cells takes longer than
    all else; of a cell that is surely free it stays as it is, 0 but for rounding: most cells are.
    """
    if level.stamp[v, u] < mark:
        before = level.log_odds[v, u]
        log_odds = before + update.free
        level.log_odds[v, u], level.stamp[v, u] = log_odds, mark
        if log_odds > SURELY_FREE:
            p = level.p[v, u] if before != 0.0 else 0.5
            level.p[v, u] = p * update.odds / (1.0 - p + p * update.odds)


@njit(inner=True, borrows=True)
def mark_occupied(level: Level, u: np.uint64, v: np.uint64, mark: int, update: Update) -> None:
    """A beam ended in cell [v, u], once per scan: [Kohlbrecher11] sec. IV-A.

    Takes back a free mark of the same scan.
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
    """Probability as the matcher reads it, p = e^l / (1 + e^l); 0 where nothing was seen. ours."""
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
    """Update one level with a scan: free along each beam, occupied at its end, the end wins.

    [Kohlbrecher11] sec. IV-A: Bresenham lines from the sensor's cell up to the end's. `number`
    counts the insertions from 1; a beam that leaves the grid is skipped whole.
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
            continue  # the same line as the beam before: nothing new
        last_x, last_y = bx, by
        if (bx == ax and by == ay) or not (0 <= bx < width and 0 <= by < height):
            continue
        dx, dy = abs(bx - ax), abs(by - ay)
        sx, sy = (1 if bx > ax else -1), (1 if by > ay else -1)
        steep = dy > dx
        far, near = (dy, dx) if steep else (dx, dy)
        ix, iy, error = ax, ay, far // 2
        for _ in range(far):
            mark_free(level, np.uint64(ix), np.uint64(iy), mark, update)
            error += near
            aside = error >= far
            if aside:
                error -= far
            ix += sx if aside or not steep else 0
            iy += sy if aside or steep else 0
        mark_occupied(level, np.uint64(bx), np.uint64(by), mark, update)
