"""Kernels on a distance map: what a beam meets, and how well a scan fits at a pose."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.geometry import solve3
from slams.jit import njit
from slams.types import Floats

NOTHING = -1.0  # range of a beam that meets no wall
AT_WALL = 1.42  # cells: a cell at most sqrt(2) from an occupied one touches it
SHORTEST_STEP = 0.5  # cells that a ray goes on next to what is not free: no wall is thinner
MAX_ROTATION = 0.05  # rad in one step of a fit; its longest way is the robust distance
CONVERGED, CONVERGED_ROTATION = 0.01, 1e-4  # cell, rad: a step below these ends a round
DAMPING = 1.01  # of the diagonal: a direction that no wall constrains stays


class Distances(NamedTuple):
    """A map as arrays (ny, nx) [cell]; cell [iy, ix] covers ix <= x < ix + 1.

    `gap`: Chebyshev distance to the nearest cell that is not free, 0 inside such; `wall`: distance
    to the nearest occupied cell, cut off.
    """

    gap: NDArray[np.uint8]
    wall: NDArray[np.float32]


@njit(inner=True, borrows=True)
def cast(distances: Distances, x: float, y: float, c: float, s: float, far: float) -> float:
    """Range [cell] at which a beam from (x, y) along (c, s) meets a wall, at most `far`.

    ours: steps by the gap; `NOTHING` where the beam ends in unknown cells, or meets nothing.
    """
    ny, nx = distances.gap.shape
    r = 0.0
    while r < far:
        fx, fy = x + r * c, y + r * s
        if not (fx >= 0.0 and fy >= 0.0 and fx < nx and fy < ny):
            return NOTHING
        ix, iy = math.floor(fx), math.floor(fy)
        gap = distances.gap[iy, ix]
        if gap == 0:
            return r if distances.wall[iy, ix] < AT_WALL else NOTHING
        r += max(gap - 1.0, SHORTEST_STEP)
    return NOTHING


@njit
def measure(distances: Distances, pose: Floats, angles: Floats, far: float, out: Floats) -> None:
    """Ranges (n,) [cell] of beams from a pose x, y [cell], theta; `NOTHING` where there is no wall.

    ours: a wall is somewhere in its cell, so it counts as in the middle: the beam ends where it is
    nearest to the center of the first occupied cell, `far` at most.
    """
    ny, nx = distances.wall.shape
    for k in range(len(angles)):
        angle = pose[2] + angles[k]
        c, s = math.cos(angle), math.sin(angle)
        r = cast(distances, pose[0], pose[1], c, s, far)
        out[k] = NOTHING
        while r >= 0.0 and r < far:
            x, y = math.floor(pose[0] + r * c), math.floor(pose[1] + r * s)
            if not (x >= 0 and y >= 0 and x < nx and y < ny and distances.wall[y, x] < AT_WALL):
                break
            if distances.wall[y, x] == 0.0:
                out[k] = (x + 0.5 - pose[0]) * c + (y + 0.5 - pose[1]) * s
                break
            r += SHORTEST_STEP


@njit(inner=True, borrows=True)
def normal_equations(
    distances: Distances, points: Floats, soft: float, pose: Floats, H: Floats, b: Floats
) -> None:
    """Normal equations of the distances from end points (n, 2) [cell] to the nearest walls.

    ours: [Kohlbrecher11] eq. 12 and 13 on bilinear distances; weights (1 + (e / soft)^2)^-2.
    """
    ny, nx = distances.wall.shape
    c, s = math.cos(pose[2]), math.sin(pose[2])
    H[:3], b[:] = 0.0, 0.0
    for i in range(len(points)):
        qx, qy = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
        x, y = pose[0] + qx - 0.5, pose[1] + qy - 0.5
        if not (x >= 0.0 and y >= 0.0 and x < nx - 1 and y < ny - 1):
            continue
        ix, iy = math.floor(x), math.floor(y)
        fx, fy = x - ix, y - iy
        d00, d10 = distances.wall[iy, ix], distances.wall[iy, ix + 1]
        d01, d11 = distances.wall[iy + 1, ix], distances.wall[iy + 1, ix + 1]
        low, high = d00 + fx * (d10 - d00), d01 + fx * (d11 - d01)
        e = low + fy * (high - low)
        gx = (1.0 - fy) * (d10 - d00) + fy * (d11 - d01)
        gy = (1.0 - fx) * (d01 - d00) + fx * (d11 - d10)
        gt = gy * qx - gx * qy
        w = 1.0 / (1.0 + (e / soft) ** 2)
        w *= w
        H[0, 0] += w * gx * gx
        H[0, 1] += w * gx * gy
        H[1, 1] += w * gy * gy
        H[0, 2] += w * gx * gt
        H[1, 2] += w * gy * gt
        H[2, 2] += w * gt * gt
        b[0] -= w * e * gx
        b[1] -= w * e * gy
        b[2] -= w * e * gt
    H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]


@njit
def fit(distances: Distances, points: Floats, softs: Floats, steps: int, pose: Floats) -> None:
    """Move a pose x, y [cell], theta so that end points (n, 2) [cell] lie on walls.

    ours: damped Gauss-Newton, a round of at most `steps` for each robust distance in `softs`
    [cell], from far walls to near ones.
    """
    room = np.empty((5, 3))
    H, b, step = room[:3], room[3], room[4]
    for soft in softs:
        for _ in range(steps):
            normal_equations(distances, points, soft, pose, H, b)
            for j in range(3):
                H[j, j] *= DAMPING
            if not solve3(H, b, step):
                break
            for j in range(3):
                limit = MAX_ROTATION if j == 2 else soft
                pose[j] += max(-limit, min(limit, step[j]))
            way = max(abs(step[0]), abs(step[1]))
            if way < CONVERGED and abs(step[2]) < CONVERGED_ROTATION:
                break


@njit
def evaluate(
    distances: Distances, points: Floats, pose: Floats, near: float, before: float
) -> tuple[float, float]:
    """Shares of beams, ending in points (n, 2) [cell], that are inliers and in conflict at a pose.

    ours: a conflict is a beam that goes through a wall `before` [cell] its end; an inlier, of the
    others, one that ends within `near` [cell] of a wall. Somebody may stand in the way of a beam
    that ends in free space, and nothing is known of one that ends elsewhere: neither.
    """
    ny, nx = distances.gap.shape
    c, s = math.cos(pose[2]), math.sin(pose[2])
    inliers = conflicts = 0
    for i in range(len(points)):
        qx, qy = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
        r = math.sqrt(qx * qx + qy * qy)
        if r < 1.0:
            continue
        free = cast(distances, pose[0], pose[1], qx / r, qy / r, r)
        x, y = pose[0] + qx, pose[1] + qy
        if free >= 0.0 and free < r - before:
            conflicts += 1
        elif x >= 0.0 and y >= 0.0 and x < nx and y < ny:
            inliers += distances.wall[math.floor(y), math.floor(x)] <= near
    n = max(len(points), 1)
    return inliers / n, conflicts / n
