"""Kernels of scan matching: hill climbing of the rays' fitness, inliers and conflicts."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from crsm.map_kernels import Grid, darkness
from slams.geometry import student_cost, wrap_angle
from slams.jit import FAST, njit
from slams.scan.scan_kernels import Points

MAX_ROUNDS = 10  # of a step along each axis, before the step is halved
MIN_RAY_RADIUS = 0.1  # m, rms of the rays' end points about their mean; bounds the rotation step
FREE_GRAY = -0.55  # 1; a cell below is free: observed by three scans


class WeightedPrior(NamedTuple):
    """Prior of the pose: predicted x, y, theta and information (3, 3).

    `weight` is the fitness that one unit of the negative log of the prior costs.
    """

    x: float
    y: float
    theta: float
    information: Any
    weight: float


@njit(fastmath=FAST, inner=True, borrows=True)
def fitness(grid: Grid, rays: Any, pose: Any) -> float:
    """[Tsardoulias13] fitness: mean darkness of the map under the rays' end points (k, 2) [m]."""
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
def score(grid: Grid, rays: Any, prior: WeightedPrior, pose: Any) -> float:
    """ours: fitness less the cost of the prior, which has Student's tails."""
    x, y, theta = pose
    dx, dy, dtheta = x - prior.x, y - prior.y, wrap_angle(theta - prior.theta)
    k = prior.information
    distance = k[0, 0] * dx * dx + k[1, 1] * dy * dy + k[2, 2] * dtheta * dtheta
    distance += 2.0 * (k[0, 1] * dx * dy + k[0, 2] * dx * dtheta + k[1, 2] * dy * dtheta)
    return fitness(grid, rays, pose) - prior.weight * student_cost(max(distance, 0.0))


@njit(inner=True, borrows=True)
def centroid(rays: Any) -> Any:
    """ours: mean x, y [m] of the rays' end points (k, 2), and their rms distance [m] from it."""
    k = rays.shape[0]
    mx, my, square = 0.0, 0.0, 0.0
    for j in range(k):
        mx, my = mx + rays[j, 0] / k, my + rays[j, 1] / k
    for j in range(k):
        dx, dy = rays[j, 0] - mx, rays[j, 1] - my
        square += (dx * dx + dy * dy) / k
    return mx, my, math.sqrt(square)


@njit(inner=True, borrows=True)
def neighbor(pose: Any, axis: int, step: float, mx: float, my: float) -> Any:
    """[Tsardoulias13] neighbor of a pose in x, y [m] or theta [rad]; ours: rotation about (mx, my).

    (mx, my) [m] is a point in the base frame.
    """
    x, y, theta = pose
    if axis < 2:
        return (x + step, y, theta) if axis == 0 else (x, y + step, theta)
    c, s = math.cos(theta), math.sin(theta)
    c2, s2 = math.cos(theta + step), math.sin(theta + step)
    return x + (c - c2) * mx - (s - s2) * my, y + (s - s2) * mx + (c - c2) * my, theta + step


@njit
def climb(grids: Any, rays: Any, prior: Any, start: Any, length: float, finest: float) -> Any:
    """[Tsardoulias13] hill climbing: steps along x, y and theta while the score increases.

    ours: steps are halved from `length` [m] to `finest`. While they are longer than a fine cell,
    the score is that of the coarse grid. A rotation is about the centroid of the rays and moves
    them by the length of a step. `Grid` (fine, coarse), `WeightedPrior` and start are plain tuples,
    as numba converts named tuples ten times as slowly. Returns (x, y, theta), fitness and score.
    """
    fine, coarse, pose_prior = Grid(*grids[0]), Grid(*grids[1]), WeightedPrior(*prior)
    mx, my, radius = centroid(rays)
    radius = max(radius, MIN_RAY_RADIUS)
    pose, best = start, -math.inf
    while True:
        grid = coarse if length > fine.resolution else fine
        best = score(grid, rays, pose_prior, pose)
        for _ in range(MAX_ROUNDS):
            before = best
            for axis in range(3):
                for sign in (1.0, -1.0):
                    step = sign * (length / radius if axis == 2 else length)
                    other = neighbor(pose, axis, step, mx, my)
                    value = score(grid, rays, pose_prior, other)
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
def score_starts(grid: Any, rays: Any, prior: Any, starts: Any, out: Any) -> None:
    """[Tsardoulias13] random restarts: the score (n,) of each of the starts (n, 3).

    `Grid` and `WeightedPrior` are plain tuples.
    """
    level, pose_prior = Grid(*grid), WeightedPrior(*prior)
    for i in range(starts.shape[0]):
        out[i] = score(level, rays, pose_prior, (starts[i, 0], starts[i, 1], starts[i, 2]))


@njit
def evaluate(grid: Any, points: Points, n: int, pose: Any) -> Any:
    """Inlier ratio and conflict ratio of a scan at a pose, for the gray levels without lines.

    ours: an end point is an inlier by its darkness, and in conflict in a cell that is free.
    """
    level = Grid(*grid)
    x0, y0, theta = pose
    scale = 1.0 / level.resolution
    c, s = math.cos(theta) * scale, math.sin(theta) * scale
    u, v = (x0 - level.x0) * scale, (y0 - level.y0) * scale
    height, width = level.gray.shape
    inliers = conflicts = 0.0
    for i in range(n):
        px, py = points[0, i], points[1, i]
        x, y = c * px - s * py + u, s * px + c * py + v
        if x >= 0.0 and y >= 0.0 and x < width - 1 and y < height - 1:
            inliers += darkness(level, x, y)
            conflicts += level.gray[np.uint64(y + 0.5), np.uint64(x + 0.5)] < FREE_GRAY
    return inliers / max(n, 1), conflicts / max(n, 1)


@njit
def fitness_of(grid: Any, rays: Any, pose: Any) -> float:
    """[Tsardoulias13] `fitness`, with the `Grid` as a plain tuple."""
    return fitness(Grid(*grid), rays, pose)
