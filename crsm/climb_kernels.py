"""Hill climbing of the critical rays' fitness, restarted at random."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numpy.typing import NDArray

from crsm.map_kernels import WallMap, darkness
from slams.geometry import unlikely, wrap_angle
from slams.jit import FAST, njit

FINEST, FINEST_TURN = 0.001, 1e-4  # m, rad: steps below are not made
ROUNDS = 10  # of steps of one size
LEAST_RADIUS = 0.1  # m, of the rays around their middle


class Prior(NamedTuple):
    """A pose that is expected, information (3, 3) of it [1/m^2, 1/(m rad), 1/rad^2].

    `weight` is what one unit of its negative logarithm counts against a fit.
    """

    x: float
    y: float
    theta: float
    information: NDArray[Any]
    weight: float


@njit(fastmath=FAST)
def fitness(grid: WallMap, rays: Any, pose: Any) -> float:
    """[Tsardoulias13] fitness: mean darkness of the map under the ends (k, 2) of rays."""
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    k: int = rays.shape[0]
    total: float = 0.0
    for j in range(k):
        px, py = rays[j, 0], rays[j, 1]
        total += darkness(grid, c * px - s * py + x, s * px + c * py + y)
    return total / k


@njit(inner=True)
def score(grid: WallMap, rays: Any, prior: Prior, pose: Any) -> float:
    """ours: fitness less what it costs to be elsewhere than expected (Student's tails)."""
    x, y, theta = pose
    dx, dy, turn = x - prior.x, y - prior.y, wrap_angle(theta - prior.theta)
    k = prior.information
    distance = k[0, 0] * dx * dx + k[1, 1] * dy * dy + k[2, 2] * turn * turn
    distance += 2.0 * (k[0, 1] * dx * dy + k[0, 2] * dx * turn + k[1, 2] * dy * turn)
    return fitness(grid, rays, pose) - prior.weight * unlikely(distance)


@njit(inner=True)
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


@njit(inner=True)
def stepped(pose: Any, axis: int, step: float, mx: float, my: float) -> Any:
    """[Tsardoulias13] a pose one step further along x, y [m] or theta, which is about (mx, my)."""
    x, y, theta = pose
    if axis < 2:
        return (x + step, y, theta) if axis == 0 else (x, y + step, theta)
    c, s = math.cos(theta), math.sin(theta)
    c2, s2 = math.cos(theta + step), math.sin(theta + step)
    return x + (c - c2) * mx - (s - s2) * my, y + (s - s2) * mx + (c - c2) * my, theta + step


@njit
def climb(grid: WallMap, rays: Any, prior: Prior, start: Any, length: float, finest: float) -> Any:
    """[Tsardoulias13] hill climbing: steps along x, y, theta while they help, then half as long.

    ours: from steps of `length` [m] down to `finest`, and to `FINEST_TURN` if that is `FINEST`; a
    turn is about the middle of the rays and moves them by as much as a step. Returns (x, y, theta,
    score).
    """
    mx, my, radius = middle_of(rays)
    angle = length / max(radius, LEAST_RADIUS)
    pose, best = start, score(grid, rays, prior, start)
    while True:
        for _ in range(ROUNDS):
            before = best
            for axis in range(3):
                for sign in (1.0, -1.0):
                    step = sign * (angle if axis == 2 else length)
                    other = stepped(pose, axis, step, mx, my)
                    value = score(grid, rays, prior, other)
                    if value > best:
                        best, pose = value, other
                        break
            if best == before:
                break
        if length <= finest and (finest > FINEST or angle <= FINEST_TURN):
            x, y, theta = pose
            return x, y, wrap_angle(theta), best
        length, angle = max(0.5 * length, finest), 0.5 * angle


@njit
def promising(grid: WallMap, rays: Any, prior: Prior, starts: Any, out: Any) -> None:
    """[Tsardoulias13] random restarts: the score (n,) of each of the starts (n, 3)."""
    for i in range(starts.shape[0]):
        out[i] = score(grid, rays, prior, (starts[i, 0], starts[i, 1], starts[i, 2]))
