"""Which beams of a scan fix x, y and theta: the critical rays."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slams.geometry import inverse3
from slams.jit import njit
from slams.scan.scan_kernels import Points
from slams.types import Floats, Pose2

EDGES = 0.25  # share of the rays that discontinuities may take
LEAST = 1e-6  # information that keeps H regular


@njit(inner=True)
def measured(normals: Points, i: int, noise: Any) -> Any:
    """ours: what point i measures: along x and y the unit normal of its wall, and its variance.

    (1, 1) for a lone point, which measures both; noise: variances (of a range, of a lone point).
    """
    of_range, of_lone = noise
    nx, ny = normals[0, i], normals[1, i]
    if nx == 0.0 and ny == 0.0:
        return 1.0, 1.0, of_lone, True
    return nx, ny, of_range, False


@njit(inner=True)
def add_measured(x: float, y: float, of_point: Any, H: Any) -> None:
    """ours: add what a point at (x, y) [m] tells of the pose to the upper half of `H` (3, 3).

    of_point: the normal of its wall, its variance [m^2] and whether it is lone, as of `measured`.
    """
    cx, cy, variance, lone = of_point
    w = 1.0 / variance
    H[0, 0] += w * cx * cx
    H[1, 1] += w * cy * cy
    if lone:
        H[0, 2] -= w * y
        H[1, 2] += w * x
        H[2, 2] += w * (x * x + y * y)
    else:
        turn = cy * x - cx * y
        H[0, 1] += w * cx * cy
        H[0, 2] += w * cx * turn
        H[1, 2] += w * cy * turn
        H[2, 2] += w * turn * turn


@njit(inner=True)
def leverage(points: Points, normals: Points, m: int, noise: Any, out: Any) -> None:
    """ours: share (m,) of each point in fixing the pose, w c' H^-1 c; together they are 3.

    noise: variances [m2] of a range and of a lone point, which measures x and y alike.
    """
    H = np.empty((3, 3))
    for i in range(3):
        for k in range(3):
            H[i, k] = LEAST if i == k else 0.0
    for i in range(m):
        add_measured(points[0, i], points[1, i], measured(normals, i, noise), H)
    H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]
    A = inverse3(H)
    for i in range(m):
        cx, cy, variance, lone = measured(normals, i, noise)
        x, y = points[0, i], points[1, i]
        if lone:
            share = A[0, 0] + A[1, 1] + A[2, 2] * (x * x + y * y)
            share += 2.0 * (A[1, 2] * x - A[0, 2] * y)
        else:
            t = cy * x - cx * y
            share = A[0, 0] * cx * cx + A[1, 1] * cy * cy + A[2, 2] * t * t
            share += 2.0 * (A[0, 1] * cx * cy + A[0, 2] * cx * t + A[1, 2] * cy * t)
        out[i] = share / variance


@njit
def critical_rays(
    points: Points,
    normals: Points,
    moments: Floats,
    m: int,
    laser: Pose2,
    noise: Any,
    count: int,
    out: Any,
) -> int:
    """Numbers of about `count` of m points that carry the pose, into out (n,); how many.

    [Tsardoulias13]: those at discontinuities, and of the rest the far ones more densely. ours: half
    of the rest goes to those with the greatest share in x, y and theta; chosen by error diffusion
    along the scan, without a draw. moments as of `scan_moments`; noise as in `leverage`.
    """
    room = np.empty((3, m))
    shares, edge, far = room[0], room[1], room[2]
    for i in range(m):
        edge[i] = 0.0
    for i in range(m):
        far[i] = math.hypot(points[0, i] - laser.x, points[1, i] - laser.y)
        if moments[5, i + 1] != moments[5, i]:
            edge[i] = edge[min(i + 1, m - 1)] = 1.0
    leverage(points, normals, m, noise, shares)
    edges = all_far = 0.0
    for i in range(m):
        edges += edge[i]
        all_far += far[i]
    each = min(EDGES * count / max(edges, 1.0), 1.0)
    rest = 0.5 * (count - each * edges)
    k, owed = 0, 0.0
    for i in range(m):
        owed += min(each * edge[i] + rest * (shares[i] / 3.0 + far[i] / all_far), 1.0)
        if owed >= 1.0 or m <= count:
            owed -= 1.0
            out[k] = i
            k += 1
    return k
