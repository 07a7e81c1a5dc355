"""Kernels of scan matching on the occupancy pyramid: Gauss-Newton, inliers and conflicts."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hector.map_kernels import FREE_LOG_ODDS, Level
from slams.geometry import add_prior, offset, solve3, wrap_angle
from slams.jit import FAST, njit
from slams.scan.scan_kernels import Points
from slams.types import Floats, Pose2

MAX_SQUARE_GROWTH = 2.0  # factor of a step on the mean square; a prior may raise it a little


class Solver(NamedTuple):
    """Settings of Gauss-Newton on one level.

    `steps` is the maximum number of steps; `max_shift` [m] and `max_rotation` [rad] limit a step; a
    step below `tolerance`, in m and in rad, is the last one; `damping` is the share of H's diagonal
    that is added to it; every `stride`-th end point is used.
    """

    steps: int
    max_shift: float
    max_rotation: float
    tolerance: float
    damping: float
    stride: int


@njit(inner=True, borrows=True)
def interpolate(p: NDArray[np.float32], x: float, y: float) -> tuple[float, float, float]:
    """Map value M and its gradient at (x, y) [cells]: [Kohlbrecher11] eq. 4-6; 0 off the map."""
    height, width = p.shape
    if not (x >= 0.0 and x <= width - 2 and y >= 0.0 and y <= height - 2):
        return 0.0, 0.0, 0.0
    ix, iy = math.floor(x), math.floor(y)
    fx, fy = x - ix, y - iy
    p00, p10, p01, p11 = p[iy, ix], p[iy, ix + 1], p[iy + 1, ix], p[iy + 1, ix + 1]
    low, high = p00 + fx * (p10 - p00), p01 + fx * (p11 - p01)
    gx = (1.0 - fy) * (p10 - p00) + fy * (p11 - p01)
    gy = (1.0 - fx) * (p01 - p00) + fx * (p11 - p10)
    return low + fy * (high - low), gx, gy


@njit(fastmath=FAST, inner=True, borrows=True)  # 1.2 times as fast: sums may be regrouped
def normal_equations(
    level: Level, points: Points, n: int, stride: int, pose: Pose2, H: Floats, b: Floats
) -> tuple[float, float]:
    """H and b of one linearization of the residuals 1 - M: [Kohlbrecher11] eq. 7-13.

    points (2, >= n) [m] in the base frame, every `stride`-th is used; H (3, 3) and b (3,) in meters
    and radians. Returns the score, which is the mean of M, and the residuals' mean square.
    """
    scale = 1.0 / level.resolution
    c, s = math.cos(pose.theta) * scale, math.sin(pose.theta) * scale
    ex, ey = (pose.x - level.x0) * scale, (pose.y - level.y0) * scale
    hxx = hxy = hyy = hxt = hyt = htt = bx = by = bt = total = total_square = 0.0
    for i in range(0, n, stride):
        x, y = points[0, i], points[1, i]
        qx, qy = c * x - s * y, s * x + c * y
        value, gx, gy = interpolate(level.p, ex + qx, ey + qy)
        gt = gy * qx - gx * qy
        r = 1.0 - value
        hxx += gx * gx
        hxy += gx * gy
        hyy += gy * gy
        hxt += gx * gt
        hyt += gy * gt
        htt += gt * gt
        bx += r * gx
        by += r * gy
        bt += r * gt
        total += value
        total_square += r * r
    H[0, 0], H[1, 1], H[2, 2] = hxx * scale * scale, hyy * scale * scale, htt
    H[0, 1] = H[1, 0] = hxy * scale * scale
    H[0, 2] = H[2, 0] = hxt * scale
    H[1, 2] = H[2, 1] = hyt * scale
    b[0], b[1], b[2] = bx * scale, by * scale, bt
    used = max((n + stride - 1) // stride, 1)
    return total / used, total_square / used


@njit
def climb(
    levels: Any, points: Points, n: int, start: Any, prior: Any, solvers: Any, H: Floats
) -> tuple[tuple[float, float, float], float, float]:
    """Match end points to all levels, coarse to fine: [Kohlbrecher11] sec. IV-C.

    Arguments and results are those of `gauss_newton`, for `Level` and `Solver` of each level,
    finest first. All are plain tuples, as numba converts named tuples ten times as slowly.
    """
    x, y, theta = start
    score = mean_square = 0.0
    for k in range(len(levels) - 1, -1, -1):
        level = Level(*levels[k])
        pose, score, mean_square = gauss_newton(
            level, points, n, (x, y, theta), prior, solvers[k], H
        )
        x, y, theta = pose.x, pose.y, pose.theta
    return (x, y, theta), score, mean_square


@njit(inner=True)
def gauss_newton(
    level: Level, points: Points, n: int, start: Any, prior: Any, solver: Any, H: Floats
) -> tuple[Pose2, float, float]:
    """Match end points to one level: steps of [Kohlbrecher11] eq. 12 from `start`.

    ours: a prior of the pose, weighted by the residuals' mean square as their variance. A step that
    multiplies the mean square is undone, and ends the level: where p is 0.99 the gradient is next
    to nothing, and the step that follows from it leaves the wall.

    Returns the pose, and the score and the residuals' mean square of the last linearization, whose
    H is left in `H`.
    """
    x, y, theta = start
    (prior_x, prior_y, prior_theta), information = prior
    prior_pose = Pose2(prior_x, prior_y, prior_theta)
    steps, max_shift, max_rotation, tolerance, damping, stride = solver
    scratch = np.empty((5, 3))  # one array: each further type costs half a second to compile
    b, step, damped = scratch[3], scratch[4], scratch
    score = mean_square = 0.0
    last, last_square = Pose2(x, y, theta), math.inf
    for _ in range(steps):
        pose = Pose2(x, y, theta)
        score, mean_square = normal_equations(level, points, n, stride, pose, H, b)
        if mean_square > MAX_SQUARE_GROWTH * last_square:
            x, y, theta = last
            score, mean_square = normal_equations(level, points, n, stride, last, H, b)
            break
        last, last_square = pose, mean_square
        add_prior(H, information, mean_square, offset(pose, prior_pose), damped, b)
        for k in range(3):
            damped[k, k] += damping * H[k, k]
        if not solve3(damped, b, step):
            break
        length = math.hypot(step[0], step[1])
        if length > max_shift:
            step[0] *= max_shift / length
            step[1] *= max_shift / length
        x, y = x + step[0], y + step[1]
        theta += max(-max_rotation, min(max_rotation, step[2]))
        if length < tolerance and abs(step[2]) < tolerance:
            break
    return Pose2(x, y, wrap_angle(theta)), score, mean_square


@njit
def evaluate(level: Level, points: Points, n: int, pose: Pose2) -> tuple[float, float]:
    """Inlier ratio and conflict ratio of a scan at a pose, for the pyramid without lines.

    ours: an end point is an inlier where p > 0.5, and in conflict in a cell that is free.
    """
    height, width = level.log_odds.shape
    scale = 1.0 / level.resolution
    c, s = math.cos(pose.theta) * scale, math.sin(pose.theta) * scale
    ex, ey = (pose.x - level.x0) * scale + 0.5, (pose.y - level.y0) * scale + 0.5
    inliers = conflicts = 0
    for i in range(n):
        x, y = points[0, i], points[1, i]
        fx, fy = ex + c * x - s * y, ey + s * x + c * y
        if fx >= 0.0 and fy >= 0.0 and fx < width and fy < height:
            log_odds = level.log_odds[np.uint64(fy), np.uint64(fx)]
            inliers += log_odds > 0.0
            conflicts += log_odds < FREE_LOG_ODDS
    return inliers / max(n, 1), conflicts / max(n, 1)
