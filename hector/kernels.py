"""Kernels of the occupancy pyramid: scan preparation, map matching, map update.

Coordinates of a level are real numbers in cells; the integer i is the CENTER of cell i, so that
map = (world - first) / resolution with `first` the center of cell [0, 0].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.geometry import solve3
from slams.jit import FAST, njit
from slams.types import Floats, Pose2, Ranges

Points = NDArray[np.float64]


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


class Limits(NamedTuple):
    """Which end points are used: distances [m] and whether a body filter hides near ones behind."""

    near: float
    far: float
    body: float


class Twist(NamedTuple):
    """Motion of the base during a sweep: velocity vx, vy [m/s], turn [rad/s], s per beam."""

    vx: float
    vy: float
    turn: float
    time_increment: float


class Update(NamedTuple):
    """Log-odds added to free and to occupied cells, the ceiling above which none is added.

    `unknown` is the probability the matcher reads where nothing was observed.
    """

    free: float
    occupied: float
    ceiling: float
    unknown: float


class Window(NamedTuple):
    """A search window: cells to each side, turns to each side and their step [rad]."""

    shifts: int
    turns: int
    turn_step: float


@njit
def end_points(
    ranges: Ranges, directions: Floats, mount: Pose2, limits: Limits, out: Points
) -> tuple[int, float]:
    """End points in the base frame and the beams they are of; how many, and the farthest [m].

    [Kohlbrecher11] sec. IV-A, with the filters of the original node. ranges (b,) m, directions
    (b, 2) in the laser frame, out (3, b): x, y [m], number of the beam.
    """
    c, s = math.cos(mount.theta), math.sin(mount.theta)
    n, far = 0, 0.0
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if not (limits.near < r < limits.far):
            continue
        x, y = r * directions[i, 0], r * directions[i, 1]
        if x < 0.0 and r < limits.body:
            continue
        x, y = mount.x + c * x - s * y, mount.y + s * x + c * y
        out[0, n] = x
        out[1, n] = y
        out[2, n] = i
        square = x * x + y * y
        far = square if square > far else far
        n += 1
    return n, math.sqrt(far)


@njit
def deskew(points: Points, n: int, twist: Twist) -> None:
    """Bring end points to the base frame at the first beam's time, in place.

    ours: the original ignores that the robot moves during a sweep. points (3, >= n) of
    `end_points`; the base moves on an arc, its chord turned by half the turn.
    """
    for i in range(n):
        t = points[2, i] * twist.time_increment
        turn = twist.turn * t
        c, s = math.cos(turn), math.sin(turn)
        ch, sh = math.cos(0.5 * turn), math.sin(0.5 * turn)
        x, y, vx, vy = points[0, i], points[1, i], twist.vx * t, twist.vy * t
        points[0, i] = c * x - s * y + ch * vx - sh * vy
        points[1, i] = s * x + c * y + sh * vx + ch * vy


@njit(inner=True)
def interpolate(
    p: NDArray[np.float32], x: float, y: float, exact: bool
) -> tuple[float, float, float]:
    """Map value and gradient at (x, y) [cells]: [Kohlbrecher11] eq. 4-6.

    With `exact` False the gradient has the interpolation weights of x and y exchanged, as in the
    original code. Outside the map all three are 0.
    """
    height, width = p.shape
    if not (x >= 0.0 and x <= width - 2 and y >= 0.0 and y <= height - 2):
        return 0.0, 0.0, 0.0
    ix, iy = math.floor(x), math.floor(y)
    fx, fy = x - ix, y - iy
    p00, p10, p01, p11 = p[iy, ix], p[iy, ix + 1], p[iy + 1, ix], p[iy + 1, ix + 1]
    low, high = p00 + fx * (p10 - p00), p01 + fx * (p11 - p01)
    ux, uy = (fy, fx) if exact else (fx, fy)
    gx = (1.0 - ux) * (p10 - p00) + ux * (p11 - p01)
    gy = (1.0 - uy) * (p01 - p00) + uy * (p11 - p10)
    return low + fy * (high - low), gx, gy


class Solver(NamedTuple):
    """How Gauss-Newton steps are taken.

    At most `steps` steps; a step is limited to `shift` [m] and `turn` [rad]; done when it is below
    `tolerance` [m] and [rad] times 1 m; the share `damping` of H's diagonal is added to it.
    """

    steps: int
    shift: float
    turn: float
    tolerance: float
    damping: float
    exact: bool


@njit(fastmath=FAST, inner=True)  # 1.2 times as fast: sums may be regrouped
def normal_equations(
    level: Level, points: Points, n: int, pose: Pose2, exact: bool, H: Floats, b: Floats
) -> float:
    """Sums of one linearization and the score, the mean map value: [Kohlbrecher11] eq. 7-13.

    points (2, >= n) m in the base frame; H (3, 3) and b (3,) in meters and radians.
    """
    scale = 1.0 / level.resolution
    c, s = math.cos(pose.theta) * scale, math.sin(pose.theta) * scale
    ex, ey = (pose.x - level.x0) * scale, (pose.y - level.y0) * scale
    hxx = hxy = hyy = hxt = hyt = htt = bx = by = bt = total = 0.0
    for i in range(n):
        x, y = points[0, i], points[1, i]
        qx, qy = c * x - s * y, s * x + c * y
        value, gx, gy = interpolate(level.p, ex + qx, ey + qy, exact)
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
    H[0, 0], H[1, 1], H[2, 2] = hxx * scale * scale, hyy * scale * scale, htt
    H[0, 1] = H[1, 0] = hxy * scale * scale
    H[0, 2] = H[2, 0] = hxt * scale
    H[1, 2] = H[2, 1] = hyt * scale
    b[0], b[1], b[2] = bx * scale, by * scale, bt
    return total / max(n, 1)


@njit
def gauss_newton(
    level: Level, points: Points, n: int, start: Pose2, solver: Solver, H: Floats
) -> tuple[Pose2, float]:
    """Match end points to one level: steps of [Kohlbrecher11] eq. 12 from `start`.

    Returns the pose and the mean map value at the last linearization, whose H is left in `H`.
    """
    x, y, theta = start
    b, step = np.zeros(3), np.zeros(3)
    score = 0.0
    for _ in range(solver.steps):
        pose = Pose2(x, y, theta)
        score = normal_equations(level, points, n, pose, solver.exact, H, b)
        for k in range(3):
            H[k, k] *= 1.0 + solver.damping
        if not solve3(H, b, step):
            break
        length = math.hypot(step[0], step[1])
        if length > solver.shift:
            step[0] *= solver.shift / length
            step[1] *= solver.shift / length
        x, y = x + step[0], y + step[1]
        theta += max(-solver.turn, min(solver.turn, step[2]))
        if length < solver.tolerance and abs(step[2]) < solver.tolerance:
            break
    return Pose2(x, y, theta), score


@njit(inner=True)
def mark_free(level: Level, u: np.uint64, v: np.uint64, mark: int, update: Update) -> None:
    """A beam passed cell [v, u], once per scan: inverse sensor model, [Kohlbrecher11] sec. IV-A."""
    if level.stamp[v, u] < mark:
        level.log_odds[v, u] += update.free
        level.stamp[v, u] = mark
        level.p[v, u] = probability(level.log_odds[v, u], update.unknown)


@njit(inner=True)
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
    level.p[v, u] = probability(level.log_odds[v, u], update.unknown)


@njit(inner=True)
def probability(log_odds: float, unknown: float) -> float:
    """Probability as the matcher reads it, p = e^l / (1 + e^l); `unknown` for exactly 0. ours."""
    if log_odds == 0.0:
        return unknown
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


@njit
def search(
    level: Level, points: Points, n: int, stride: int, center: Pose2, window: Window, out: Floats
) -> int:
    """Best shift for each turn of a window around `center`, by the mean map value of the cells.

    ours: exhaustive, for when the gradient has lost the way. out (k, 4): x, y, theta, score for
    each turn; returns how many rows.
    """
    height, width = level.p.shape
    scale = 1.0 / level.resolution
    turns, shifts = window.turns, window.shifts
    for row in range(2 * turns + 1):
        theta = center.theta + (row - turns) * window.turn_step
        c, s = math.cos(theta) * scale, math.sin(theta) * scale
        ex, ey = (center.x - level.x0) * scale + 0.5, (center.y - level.y0) * scale + 0.5
        out[row, 3] = -1.0
        for jy in range(-shifts, shifts + 1):
            for jx in range(-shifts, shifts + 1):
                total = 0.0
                for i in range(0, n, stride):
                    x, y = points[0, i], points[1, i]
                    fx, fy = ex + jx + c * x - s * y, ey + jy + s * x + c * y
                    if fx >= 0.0 and fy >= 0.0 and fx < width and fy < height:
                        total += level.p[np.uint64(fy), np.uint64(fx)]
                if total > out[row, 3]:
                    out[row, 0] = center.x + jx * level.resolution
                    out[row, 1] = center.y + jy * level.resolution
                    out[row, 2], out[row, 3] = theta, total
        out[row, 3] *= stride / max(n, 1)
    return 2 * turns + 1
