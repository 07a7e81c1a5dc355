"""Fitting all points of a scan to the walls of the map."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from crsm.climb_kernels import Prior
from crsm.map_kernels import NX, NY, WEIGHT, WallMap, X, Y, darkness, nearest_wall
from crsm.scan_kernels import Points
from slams.geometry import add_prior, solve3, wrap_angle
from slams.jit import FAST, njit
from slams.types import Floats, Pose2

ROUNDS, ENOUGH, ENOUGH_TURN = 20, 1e-4, 3e-5  # 1, m, rad
SAME_WALLS = 5e-3  # m, rad: after a step below this every point is still on its wall


class Rules(NamedTuple):
    """When a point is of a wall, and what it then weighs.

    gate [m] across the wall; compat, least cosine between the normals; variances of ranges [m2],
    lone points [m2] and wall directions [rad2]; squares of the scales of robustness [sigma2] and
    agreement [m2].
    """

    gate: float
    compat: float
    range2: float
    lone2: float
    lean2: float
    robust2: float
    agreement2: float


@njit(fastmath=FAST)
def normal_equations(
    grid: WallMap, points: Points, m: int, pose: Any, rules: Rules, out: Any
) -> None:
    """ours: H, g of the distances of m points to the walls nearest to them, and how well they fit.

    pose (x, y, theta, 1 to look for the walls, 0 to take those found before); out (13,): H upper
    (6), g (3), agreement, the robust loss (a point without a wall at the most), the weighted
    squares of residuals over variances, the sum of these weights. A wall tells about the way along
    its normal, a lone point about both.
    """
    xy, normal, found, wall, cell = points.xy, points.normal, points.wall, grid.wall, grid.cell
    k2, agree2, lone2 = rules.robust2, rules.agreement2, rules.lone2
    c, s = math.cos(pose[2]), math.sin(pose[2])
    (x0, y0), (ny_cells, nx_cells) = grid.corner, grid.blot.shape[:2]
    hxx = hxy = hxt = hyy = hyt = htt = gx = gy = gt = agreement = squares = weights = 0.0
    loss = k2 * m
    for i in range(m):
        px, py, nx, ny = xy[i, 0], xy[i, 1], normal[i, 0], normal[i, 1]
        rx, ry = c * px - s * py, s * px + c * py
        x, y = rx + pose[0], ry + pose[1]
        if pose[3] > 0.0:
            jx, jy = math.floor((x - x0) / cell), math.floor((y - y0) / cell)
            if min(jx, jy) < 1 or jx >= nx_cells - 1 or jy >= ny_cells - 1:
                continue
            point = (x, y, c * nx - s * ny, s * nx + c * ny)
            found[i, 0], found[i, 1] = nearest_wall(wall, jx, jy, point, rules.gate, rules.compat)
        jx, jy = found[i, 0], found[i, 1]
        if jx == 0:
            continue
        wx, wy = wall[jy, jx, NX], wall[jy, jx, NY]
        dx, dy = x - wall[jy, jx, X], y - wall[jy, jx, Y]
        d2 = dx * dx + dy * dy
        if wx == 0.0 and wy == 0.0:
            r2, variance = d2, lone2
            axx, axy, ayy = 1.0, 0.0, 1.0
        else:
            r2 = (wx * dx + wy * dy) ** 2
            loose = lone2 if nx == 0.0 and ny == 0.0 else 0.5 * points.spread[i]
            variance = rules.range2 * (1.0 + 1.0 / wall[jy, jx, WEIGHT])
            variance += loose + rules.lean2 * (d2 - r2)
            axx, axy, ayy = wx * wx, wx * wy, wy * wy
        share = k2 / (k2 + r2 / variance)
        loss -= k2 * share
        share *= share
        weights, squares = weights + share, squares + share * r2 / variance
        w = share / variance
        axx, axy, ayy = w * axx, w * axy, w * ayy
        tx, ty = axy * rx - axx * ry, ayy * rx - axy * ry
        bx, by = axx * dx + axy * dy, axy * dx + ayy * dy
        hxx += axx
        hxy += axy
        hyy += ayy
        hxt += tx
        hyt += ty
        htt += ty * rx - tx * ry
        gx += bx
        gy += by
        gt += by * rx - bx * ry
        agreement += agree2 / (agree2 + r2)
    out[0], out[1], out[2], out[3], out[4], out[5] = hxx, hxy, hxt, hyy, hyt, htt
    out[6], out[7], out[8], out[9] = gx, gy, gt, agreement
    out[10], out[11], out[12] = loss, squares, weights


@njit
def fit_to_walls(
    grid: WallMap, points: Points, m: int, start: Any, prior: Prior, rules: Rules, out: Any
) -> Any:
    """ours: Gauss-Newton of the distances of m points to their walls, with a prior.

    prior.weight: variance of the residuals over what `rules` expect; out as of `normal_equations`.
    Returns the pose (x, y, theta).
    """
    x, y, theta = start
    H, both = np.zeros((3, 3)), np.zeros((3, 3))
    b, step = np.zeros(3), np.zeros(3)
    look = 1.0
    for _ in range(ROUNDS):
        normal_equations(grid, points, m, (x, y, theta, look), rules, out)
        unpack(out, H, b)
        off = Pose2(prior.x - x, prior.y - y, wrap_angle(prior.theta - theta))
        add_prior(H, prior.information, prior.weight, off, both, b)
        if not solve3(both, b, step):
            break
        x, y, theta = x + step[0], y + step[1], theta + step[2]
        far, turn = max(abs(step[0]), abs(step[1])), abs(step[2])
        if far < ENOUGH and turn < ENOUGH_TURN:
            break
        look = 1.0 if max(far, turn) > SAME_WALLS else 0.0
    return x, y, wrap_angle(theta)


@njit(inner=True)
def unpack(system: Any, H: Floats, b: Floats) -> None:
    """ours: H (3, 3) and b = -g (3,) of what `normal_equations` put out."""
    H[0, 0], H[0, 1], H[0, 2] = system[0], system[1], system[2]
    H[1, 0], H[1, 1], H[1, 2] = system[1], system[3], system[4]
    H[2, 0], H[2, 1], H[2, 2] = system[2], system[4], system[5]
    b[0], b[1], b[2] = -system[6], -system[7], -system[8]


@njit
def evidence(grid: WallMap, points: Points, m: int, pose: Any, every: int) -> Any:
    """ours: share of m points that the map explains at a pose, and that it contradicts.

    Explained: the map is dark there; contradicted: it is white.
    """
    step = grid.cell / grid.fine
    c, s = math.cos(pose[2]), math.sin(pose[2])
    dark = white = 0.0
    for i in range(0, m, every):
        px, py = points.xy[i, 0], points.xy[i, 1]
        x, y = c * px - s * py + pose[0], s * px + c * py + pose[1]
        here = min(darkness(grid, x, y), 1.0)
        dark += here
        ix, iy = math.floor((x - grid.corner[0]) / step), math.floor((y - grid.corner[1]) / step)
        if 0 <= ix < grid.grey.shape[1] and 0 <= iy < grid.grey.shape[0]:
            white += (1.0 - here) * max(-grid.grey[iy, ix], 0.0)
    n = max((m + every - 1) // every, 1)
    return dark / n, white / n
