"""Finding the pose: hill climbing over the critical rays, then a fit of all points."""

from __future__ import annotations

import math
from typing import Any

from crsm.map_kernels import NX, NY, WEIGHT, WallMap, X, Y, nearest_wall
from crsm.scan_kernels import Points
from slams.jit import FAST, njit

BLACK = 255.0
HALVINGS = 3
ROUNDS = 10  # of steps of one size
PROMISING = 0.5  # of the best fitness: below, a restart is not climbed from


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
    grid: WallMap, points: Points, m: int, pose: Any, rules: Any, out: Any
) -> None:
    """ours: H, g of the distances of all points to the walls nearest to them, and the agreement.

    rules (gate [m], least cosine, range variance [m2], lone variance [m2], lean variance [rad2],
    robust scale k [sigma], agreement variance [m2]); out (10,): H upper (6), g (3), agreement.
    """
    xy, normal, spread = points.xy, points.normal, points.spread
    gate, compat, noise2, lone2, lean2, k2, agree2 = rules
    wall, cell = grid.wall, grid.cell
    c, s = math.cos(pose[2]), math.sin(pose[2])
    ny_cells, nx_cells = grid.dark.shape
    hxx = hxy = hxt = hyy = hyt = htt = gx = gy = gt = agreement = 0.0
    for i in range(m):
        px, py = xy[i, 0], xy[i, 1]
        nx, ny = normal[i, 0], normal[i, 1]
        rx, ry = c * px - s * py, s * px + c * py
        x, y = rx + pose[0], ry + pose[1]
        ix = math.floor((x - grid.corner[0]) / cell)
        iy = math.floor((y - grid.corner[1]) / cell)
        if ix < 1 or iy < 1 or ix >= nx_cells - 1 or iy >= ny_cells - 1:
            continue
        point = (x, y, c * nx - s * ny, s * nx + c * ny)
        jx, jy, d2 = nearest_wall(wall, ix, iy, point, gate, compat)
        if jx < 0:
            continue
        wx, wy = float(wall[jy, jx, NX]), float(wall[jy, jx, NY])
        dx, dy = x - wall[jy, jx, X], y - wall[jy, jx, Y]
        if wx == 0.0 and wy == 0.0:
            w = (k2 / (k2 + d2 / lone2)) ** 2 / lone2
            hxx += w
            hyy += w
            hxt -= w * ry
            hyt += w * rx
            htt += w * (rx * rx + ry * ry)
            gx += w * dx
            gy += w * dy
            gt += w * (rx * dy - ry * dx)
            agreement += agree2 / (agree2 + d2)
            continue
        r2 = (wx * dx + wy * dy) ** 2
        loose = lone2 if nx == 0.0 and ny == 0.0 else 0.5 * spread[i]
        variance = noise2 * (1.0 + 1.0 / wall[jy, jx, WEIGHT]) + loose + lean2 * (d2 - r2)
        w = (k2 / (k2 + r2 / variance)) ** 2 / variance
        turn = wy * rx - wx * ry
        wr = w * (wx * dx + wy * dy)
        hxx += w * wx * wx
        hxy += w * wx * wy
        hxt += w * wx * turn
        hyy += w * wy * wy
        hyt += w * wy * turn
        htt += w * turn * turn
        gx += wr * wx
        gy += wr * wy
        gt += wr * turn
        agreement += agree2 / (agree2 + r2)
    out[0], out[1], out[2], out[3], out[4], out[5] = hxx, hxy, hxt, hyy, hyt, htt
    out[6], out[7], out[8], out[9] = gx, gy, gt, agreement
