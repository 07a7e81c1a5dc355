"""Finding the pose: hill climbing over the critical rays, then a fit of all points."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from crsm.map_kernels import NX, NY, WEIGHT, WallMap, X, Y, nearest_wall
from crsm.scan_kernels import Points
from slams.jit import FAST, njit

BLACK = 255.0
HALVINGS = 3
ROUNDS = 10  # of steps of one size
PROMISING = 0.5  # of the best fitness: below, a restart is not climbed from


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


@njit
def fitness(grid: WallMap, points: Points, rays: Any, k: int, pose: Any) -> float:
    """[Tsardoulias13] fitness 0..1: mean darkness of the map under the ends of k critical rays."""
    xy = points.xy
    c, s = math.cos(pose[2]), math.sin(pose[2])
    ny, nx = grid.dark.shape
    total = 0
    for j in range(k):
        px, py = xy[rays[j], 0], xy[rays[j], 1]
        ix = math.floor((c * px - s * py + pose[0] - grid.corner[0]) / grid.cell)
        iy = math.floor((s * px + c * py + pose[1] - grid.corner[1]) / grid.cell)
        if 0 <= ix < nx and 0 <= iy < ny:
            total += int(grid.dark[iy, ix])
    return total / (BLACK * max(k, 1))


@njit
def climb(grid: WallMap, points: Points, rays: Any, k: int, pose: Any, steps: Any) -> Any:
    """[Tsardoulias13] hill climbing: steps along x, y, theta while they help, then half as long.

    steps (m, rad). Returns (x, y, theta, fitness).
    """
    x, y, theta = pose
    best = fitness(grid, points, rays, k, pose)
    length, angle = steps
    for _ in range(HALVINGS):
        for _ in range(ROUNDS):
            before = best
            for way in range(6):
                sign = 1.0 - 2.0 * (way % 2)
                dx = sign * length if way < 2 else 0.0
                dy = sign * length if 2 <= way < 4 else 0.0
                turn = sign * angle if way >= 4 else 0.0
                score = fitness(grid, points, rays, k, (x + dx, y + dy, theta + turn))
                if score > best:
                    best, x, y, theta = score, x + dx, y + dy, theta + turn
            if best == before:
                break
        length *= 0.5
        angle *= 0.5
    return x, y, theta, best


@njit
def restart_hill_climb(
    grid: WallMap, points: Points, rays: Any, k: int, draws: Any, rules: Any, out_pose: Any
) -> int:
    """[Tsardoulias13] random restart hill climbing around a pose until the fitness reaches a goal.

    draws (n, 3) m, m, rad; rules (step [m], turn [rad], goal); out_pose (4,): start on entry, then
    the best pose and its fitness. Returns the restarts used.
    """
    start = (out_pose[0], out_pose[1], out_pose[2])
    steps = (rules[0], rules[1])
    best = climb(grid, points, rays, k, start, steps)
    used = 0
    while used < draws.shape[0] and best[3] < rules[2]:
        d = draws[used]
        used += 1
        trial = (start[0] + d[0], start[1] + d[1], start[2] + d[2])
        if fitness(grid, points, rays, k, trial) > PROMISING * best[3]:
            found = climb(grid, points, rays, k, trial, steps)
            if found[3] > best[3]:
                best = found
    for j in range(4):
        out_pose[j] = best[j]
    return used


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
    (x0, y0), (ny_cells, nx_cells) = grid.corner, grid.dark.shape
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
