"""Kernels on a distance map: ray casting, the fit of a scan, its inliers and conflicts."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.geometry import solve3
from slams.jit import njit
from slams.types import Floats

NO_RANGE = -1.0  # of a beam that meets no wall
MAX_CONTACT_DISTANCE = 1.42  # cells: neighbors, diagonal ones too, are at most sqrt(2) apart
MIN_RAY_STEP = 0.5  # cells beside a cell that is not free: no wall is thinner
MAX_FIT_ROTATION = 0.05  # rad in one step of a fit; a translation is limited by the robust distance
FIT_TOLERANCE, FIT_ROTATION_TOLERANCE = 0.01, 1e-4  # cell, rad: a step below these ends a round
FIT_DAMPING = 1.01  # factor of the diagonal: no motion along a degenerate direction


class Distances(NamedTuple):
    """A map as arrays (ny, nx) of distances [cell]; cell [iy, ix] covers ix <= x < ix + 1.

    `gap`: Chebyshev distance to the nearest cell that is not free; `wall`: truncated Euclidean
    distance to the nearest occupied cell.
    """

    gap: NDArray[np.uint8]
    wall: NDArray[np.float32]


@njit(inner=True, borrows=True)
def cast(distances: Distances, x: float, y: float, c: float, s: float, far: float) -> float:
    """Range [cell] at which a beam from (x, y) along (c, s) meets a wall, at most `far`.

    ours: a ray advances by the gap; `NO_RANGE` if it meets no wall or ends in unknown cells.
    """
    ny, nx = distances.gap.shape
    r = 0.0
    while r < far:
        fx, fy = x + r * c, y + r * s
        if not (fx >= 0.0 and fy >= 0.0 and fx < nx and fy < ny):
            return NO_RANGE
        ix, iy = math.floor(fx), math.floor(fy)
        gap = distances.gap[iy, ix]
        if gap == 0:
            return r if distances.wall[iy, ix] < MAX_CONTACT_DISTANCE else NO_RANGE
        r += max(gap - 1.0, MIN_RAY_STEP)
    return NO_RANGE


@njit
def measure(distances: Distances, pose: Floats, angles: Floats, far: float, out: Floats) -> None:
    """Ranges (n,) [cell] of beams from a pose x, y [cell], theta; `NO_RANGE` if they meet no wall.

    ours: a wall is assumed in the middle of its cell, so that a beam ends where it is nearest to
    the center of the first occupied cell, at most `far` [cell] away.
    """
    ny, nx = distances.wall.shape
    for k in range(len(angles)):
        angle = pose[2] + angles[k]
        c, s = math.cos(angle), math.sin(angle)
        r = cast(distances, pose[0], pose[1], c, s, far)
        out[k] = NO_RANGE
        while r >= 0.0 and r < far:
            x, y = math.floor(pose[0] + r * c), math.floor(pose[1] + r * s)
            inside = x >= 0 and y >= 0 and x < nx and y < ny
            if not (inside and distances.wall[y, x] < MAX_CONTACT_DISTANCE):
                break
            if distances.wall[y, x] == 0.0:
                out[k] = (x + 0.5 - pose[0]) * c + (y + 0.5 - pose[1]) * s
                break
            r += MIN_RAY_STEP


@njit(inner=True, borrows=True)
def normal_equations(
    distances: Distances, points: Floats, soft: float, pose: Floats, H: Floats, b: Floats
) -> None:
    """Normal equations H, b of the distances from end points (n, 2) [cell] to the nearest walls.

    ours: [Kohlbrecher11] eq. 12 and 13 on bilinear distances e; weights (1 + (e / soft)^2)^-2.
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
    """Move a pose x, y [cell], theta in place so that end points (n, 2) [cell] lie on walls.

    ours: damped Gauss-Newton, at most `steps` for each of the falling robust distances `softs`
    [cell]: far walls have no weight any more in the last round.
    """
    scratch = np.empty((5, 3))
    H, b, step = scratch[:3], scratch[3], scratch[4]
    for soft in softs:
        for _ in range(steps):
            normal_equations(distances, points, soft, pose, H, b)
            for j in range(3):
                H[j, j] *= FIT_DAMPING
            if not solve3(H, b, step):
                break
            for j in range(3):
                limit = MAX_FIT_ROTATION if j == 2 else soft
                pose[j] += max(-limit, min(limit, step[j]))
            distance = max(abs(step[0]), abs(step[1]))
            if distance < FIT_TOLERANCE and abs(step[2]) < FIT_ROTATION_TOLERANCE:
                break


@njit
def evaluate(
    distances: Distances, points: Floats, pose: Floats, near: float, before: float
) -> tuple[float, float]:
    """Inlier ratio and free-space conflict, as shares of beams with end points (n, 2) [cell].

    ours: a beam is in conflict if it passes a wall more than `before` [cell] before its end point;
    any other beam is an inlier if it ends within `near` [cell] of a wall. A beam that ends in free
    space (at a person) or in unknown space is neither.
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
