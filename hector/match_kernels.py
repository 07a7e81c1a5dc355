"""Kernels of map matching on the occupancy pyramid: Gauss-Newton, inliers and conflicts."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hector.map_kernels import FREE, Level
from slams.geometry import add_prior, offset, solve3, wrap_angle
from slams.jit import FAST, njit
from slams.scan.scan_kernels import Points
from slams.types import Floats, Pose2


class Solver(NamedTuple):
    """How Gauss-Newton steps are taken.

    At most `steps` steps; a step is limited to `shift` [m] and `turn` [rad]; done when it is below
    `tolerance` [m] and [rad] times 1 m; the share `damping` of H's diagonal is added to it. Every
    `stride`-th end point is used.
    """

    steps: int
    shift: float
    turn: float
    tolerance: float
    damping: float
    stride: int


@njit(inner=True, borrows=True)
def interpolate(p: NDArray[np.float32], x: float, y: float) -> tuple[float, float, float]:
    """Map value and gradient at (x, y) [cells]: [Kohlbrecher11] eq. 4-6; outside of the map 0."""
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
    """Sums of one linearization and the score, the mean map value: [Kohlbrecher11] eq. 7-13.

    points (2, >= n) m in the base frame, every `stride`-th is used; H (3, 3) and b (3,) in meters
    and radians. Returns the score and the residuals' mean square.
    """
    scale = 1.0 / level.resolution
    c, s = math.cos(pose.theta) * scale, math.sin(pose.theta) * scale
    ex, ey = (pose.x - level.x0) * scale, (pose.y - level.y0) * scale
    hxx = hxy = hyy = hxt = hyt = htt = bx = by = bt = total = squares = 0.0
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
        squares += r * r
    H[0, 0], H[1, 1], H[2, 2] = hxx * scale * scale, hyy * scale * scale, htt
    H[0, 1] = H[1, 0] = hxy * scale * scale
    H[0, 2] = H[2, 0] = hxt * scale
    H[1, 2] = H[2, 1] = hyt * scale
    b[0], b[1], b[2] = bx * scale, by * scale, bt
    used = max((n + stride - 1) // stride, 1)
    return total / used, squares / used


@njit
def climb(
    levels: Any, points: Points, n: int, start: Any, prior: Any, solvers: Any, H: Floats
) -> tuple[tuple[float, float, float], float, float]:
    """Match end points coarse to fine, [Kohlbrecher11] sec. IV-C; as of `gauss_newton`.

    `Level`, `Solver` (finest first), start, `Prior` and what is returned are plain tuples: those
    pass between Python and here in a tenth of the time.
    """
    x, y, theta = start
    score = square = 0.0
    for k in range(len(levels) - 1, -1, -1):
        level = Level(*levels[k])
        pose, score, square = gauss_newton(level, points, n, (x, y, theta), prior, solvers[k], H)
        x, y, theta = pose.x, pose.y, pose.theta
    return (x, y, theta), score, square


@njit(inner=True)
def gauss_newton(
    level: Level, points: Points, n: int, start: Any, prior: Any, solver: Any, H: Floats
) -> tuple[Pose2, float, float]:
    """Match end points to one level: steps of [Kohlbrecher11] eq. 12 from `start`.

    ours: what is known without the scan is weighed against the residuals' mean square.
    Returns the pose, the mean map value and the residuals' mean square at the last linearization,
    whose H is left in `H`.
    """
    x, y, theta = start
    (expected_x, expected_y, expected_theta), information = prior
    expected = Pose2(expected_x, expected_y, expected_theta)
    steps, longest, largest, tolerance, damping, stride = solver
    room = np.empty((5, 3))  # one array: each further kind costs half a second to compile
    b, step, total = room[3], room[4], room
    score = square = 0.0
    for _ in range(steps):
        pose = Pose2(x, y, theta)
        score, square = normal_equations(level, points, n, stride, pose, H, b)
        add_prior(H, information, square, offset(pose, expected), total, b)
        for k in range(3):
            total[k, k] += damping * H[k, k]
        if not solve3(total, b, step):
            break
        length = math.hypot(step[0], step[1])
        if length > longest:
            step[0] *= longest / length
            step[1] *= longest / length
        x, y = x + step[0], y + step[1]
        theta += max(-largest, min(largest, step[2]))
        if length < tolerance and abs(step[2]) < tolerance:
            break
    return Pose2(x, y, wrap_angle(theta)), score, square


@njit
def evaluate(level: Level, points: Points, n: int, pose: Pose2) -> tuple[float, float]:
    """Shares of the end points in cells that are rather occupied, and in free ones.

    ours: inliers and conflicts, for the pyramid without lines.
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
            conflicts += log_odds < FREE
    return inliers / max(n, 1), conflicts / max(n, 1)
