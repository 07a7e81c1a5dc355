"""Kernels of scan matching: Gauss-Newton with a fixed number of steps."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hector.original.map_kernels import Level
from slams.geometry import solve3, wrap_angle
from slams.jit import FAST, njit
from slams.scan.scan_kernels import Points
from slams.types import Floats, Pose2


@njit(inner=True)
def interpolate(p: NDArray[np.float32], x: float, y: float) -> tuple[float, float, float]:
    """Map value M and its gradient at (x, y) [cells]: [Kohlbrecher11] eq. 4-6; 0 off the map.

    Original code: the interpolation weights of x and y are exchanged in the gradient.
    """
    height, width = p.shape
    if not (x >= 0.0 and x <= width - 2 and y >= 0.0 and y <= height - 2):
        return 0.0, 0.0, 0.0
    ix, iy = math.floor(x), math.floor(y)
    fx, fy = x - ix, y - iy
    p00, p10, p01, p11 = p[iy, ix], p[iy, ix + 1], p[iy + 1, ix], p[iy + 1, ix + 1]
    low, high = p00 + fx * (p10 - p00), p01 + fx * (p11 - p01)
    gx = (1.0 - fx) * (p10 - p00) + fx * (p11 - p01)
    gy = (1.0 - fy) * (p01 - p00) + fy * (p11 - p10)
    return low + fy * (high - low), gx, gy


@njit(fastmath=FAST, inner=True)  # 1.2 times as fast: sums may be regrouped
def normal_equations(
    level: Level, points: Points, n: int, pose: Pose2, H: Floats, b: Floats
) -> None:
    """H and b of one linearization of the residuals 1 - M: [Kohlbrecher11] eq. 7-13.

    points (2, >= n) [m] in the base frame; H (3, 3) and b (3,) in meters and radians.
    """
    scale = 1.0 / level.resolution
    c, s = math.cos(pose.theta) * scale, math.sin(pose.theta) * scale
    ex, ey = (pose.x - level.x0) * scale, (pose.y - level.y0) * scale
    hxx = hxy = hyy = hxt = hyt = htt = bx = by = bt = 0.0
    for i in range(n):
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
    H[0, 0], H[1, 1], H[2, 2] = hxx * scale * scale, hyy * scale * scale, htt
    H[0, 1] = H[1, 0] = hxy * scale * scale
    H[0, 2] = H[2, 0] = hxt * scale
    H[1, 2] = H[2, 1] = hyt * scale
    b[0], b[1], b[2] = bx * scale, by * scale, bt


@njit
def gauss_newton(
    level: Level, points: Points, n: int, start: Pose2, steps: int, max_rotation: float
) -> Pose2:
    """Match end points to one level: steps of [Kohlbrecher11] eq. 12 from `start`.

    Original code: a fixed number of steps without damping, limited in rotation [rad] only.
    """
    x, y, theta = start
    H, b, step = np.zeros((3, 3)), np.zeros(3), np.zeros(3)
    for _ in range(steps):
        normal_equations(level, points, n, Pose2(x, y, theta), H, b)
        if not solve3(H, b, step):
            break
        x, y = x + step[0], y + step[1]
        theta += max(-max_rotation, min(max_rotation, step[2]))
    return Pose2(x, y, wrap_angle(theta))
