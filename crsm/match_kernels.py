"""Kernels of map matching: hill climbing of the critical rays' fitness, inliers and conflicts."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from crsm.map_kernels import Grid, darkness
from slams.geometry import student_cost, wrap_angle
from slams.jit import FAST, njit
from slams.scan.scan_kernels import Points

ROUNDS = 10  # of steps of one size
LEAST_RADIUS = 0.1  # m, of the rays around their middle
FREE = -0.55  # grey level of a cell that three scans saw free


class Expected(NamedTuple):
    """Where the prediction expects the robot: x, y, theta, its information (3, 3).

    `weight` is what one unit of its negative logarithm counts against a fit.
    """

    x: float
    y: float
    theta: float
    information: Any
    weight: float


@njit(fastmath=FAST, inner=True, borrows=True)
def fitness(grid: Grid, rays: Any, pose: Any) -> float:
    """[Tsardoulias13] fitness: mean darkness of the map under the ends (k, 2) [m] of rays."""
    x, y, theta = pose
    scale = 1.0 / grid.resolution
    c, s = math.cos(theta) * scale, math.sin(theta) * scale
    u, v = (x - grid.x0) * scale, (y - grid.y0) * scale
    k: int = rays.shape[0]
    total: float = 0.0
    for j in range(k):
        px, py = rays[j, 0], rays[j, 1]
        total += darkness(grid, c * px - s * py + u, s * px + c * py + v)
    return total / k


@njit(inner=True, borrows=True)
def score(grid: Grid, rays: Any, prior: Expected, pose: Any) -> float:
    """ours: fitness less what it costs to be elsewhere than expected (Student's tails)."""
    x, y, theta = pose
    dx, dy, turn = x - prior.x, y - prior.y, wrap_angle(theta - prior.theta)
    k = prior.information
    distance = k[0, 0] * dx * dx + k[1, 1] * dy * dy + k[2, 2] * turn * turn
    distance += 2.0 * (k[0, 1] * dx * dy + k[0, 2] * dx * turn + k[1, 2] * dy * turn)
    return fitness(grid, rays, pose) - prior.weight * student_cost(max(distance, 0.0))


@njit(inner=True, borrows=True)
def middle_of(rays: Any) -> Any:
    """ours: mean (x, y) [m] of the ends (k, 2) of rays, and how far [m] they lie off it, rms."""
    k = rays.shape[0]
    mx, my, square = 0.0, 0.0, 0.0
    for j in range(k):
        mx, my = mx + rays[j, 0] / k, my + rays[j, 1] / k
    for j in range(k):
        dx, dy = rays[j, 0] - mx, rays[j, 1] - my
        square += (dx * dx + dy * dy) / k
    return mx, my, math.sqrt(square)


@njit(inner=True, borrows=True)
def stepped(pose: Any, axis: int, step: float, mx: float, my: float) -> Any:
    """[Tsardoulias13] a pose one step further along x, y [m] or theta, which is about (mx, my)."""
    x, y, theta = pose
    if axis < 2:
        return (x + step, y, theta) if axis == 0 else (x, y + step, theta)
    c, s = math.cos(theta), math.sin(theta)
    c2, s2 = math.cos(theta + step), math.sin(theta + step)
    return x + (c - c2) * mx - (s - s2) * my, y + (s - s2) * mx + (c - c2) * my, theta + step


@njit
def climb(grids: Any, rays: Any, prior: Any, start: Any, length: float, finest: float) -> Any:
    """[Tsardoulias13] hill climbing: steps along x, y, theta while they help, then half as long.

    ours: from steps of `length` [m] down to `finest`, on the coarse grid while a step is longer
    than a fine cell; a turn is about the middle of the rays and moves them by as much as a step.
    `Grid` (fine, coarse), `Expected` and start are plain tuples: those pass between Python and here
    in a tenth of the time. Returns (x, y, theta), fitness and score.
    """
    fine, coarse, known = Grid(*grids[0]), Grid(*grids[1]), Expected(*prior)
    mx, my, radius = middle_of(rays)
    radius = max(radius, LEAST_RADIUS)
    pose, best = start, -math.inf
    while True:
        grid = coarse if length > fine.resolution else fine
        best = score(grid, rays, known, pose)
        for _ in range(ROUNDS):
            before = best
            for axis in range(3):
                for sign in (1.0, -1.0):
                    step = sign * (length / radius if axis == 2 else length)
                    other = stepped(pose, axis, step, mx, my)
                    value = score(grid, rays, known, other)
                    if value > best:
                        best, pose = value, other
                        break
            if best == before:
                break
        if length <= finest:
            x, y, theta = pose
            return (x, y, wrap_angle(theta)), fitness(fine, rays, pose), best
        length = max(0.5 * length, finest)


@njit
def promising(grid: Any, rays: Any, prior: Any, starts: Any, out: Any) -> None:
    """[Tsardoulias13] random restarts: the score (n,) of each of the starts (n, 3).

    `Grid` and `Expected` as plain tuples.
    """
    level, known = Grid(*grid), Expected(*prior)
    for i in range(starts.shape[0]):
        out[i] = score(level, rays, known, (starts[i, 0], starts[i, 1], starts[i, 2]))


@njit
def evaluate(grid: Any, points: Points, n: int, pose: Any) -> Any:
    """Shares of the end points where the map is dark, by how dark, and where it is free.

    ours: inliers and conflicts, for the grey levels without lines.
    """
    level = Grid(*grid)
    x0, y0, theta = pose
    scale = 1.0 / level.resolution
    c, s = math.cos(theta) * scale, math.sin(theta) * scale
    u, v = (x0 - level.x0) * scale, (y0 - level.y0) * scale
    height, width = level.grey.shape
    inliers = conflicts = 0.0
    for i in range(n):
        px, py = points[0, i], points[1, i]
        x, y = c * px - s * py + u, s * px + c * py + v
        if x >= 0.0 and y >= 0.0 and x < width - 1 and y < height - 1:
            inliers += darkness(level, x, y)
            conflicts += level.grey[np.uint64(y + 0.5), np.uint64(x + 0.5)] < FREE
    return inliers / max(n, 1), conflicts / max(n, 1)


@njit
def fitness_of(grid: Any, rays: Any, pose: Any) -> float:
    """[Tsardoulias13] `fitness`, of a `Grid` as a plain tuple."""
    return fitness(Grid(*grid), rays, pose)
