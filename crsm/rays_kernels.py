"""Which beams of a scan fix x, y and theta: the critical rays."""

from __future__ import annotations

import math

import numpy as np

from slams.geometry import inverse3
from slams.jit import njit
from slams.scan.scan_kernels import Points
from slams.types import Floats, Pose2

EDGES = 0.25  # share of the rays that discontinuities may take
LEAST = 1e-6  # 1 and m^2, keep H regular


@njit
def leverage(points: Points, normals: Points, m: int, H: Floats, out: Floats) -> None:
    """ours: share (m,) of each point in fixing the pose, c' H^-1 c; together they are 3.

    c is the normal (x, y) and its lever arm; H (3, 3) the sum of c c' [1, m, m^2]. A lone point has
    no normal and no share.
    """
    for i in range(3):
        for k in range(3):
            H[i, k] = LEAST if i == k else 0.0
    for i in range(m):
        nx, ny = normals[0, i], normals[1, i]
        turn = ny * points[0, i] - nx * points[1, i]
        H[0, 0] += nx * nx
        H[0, 1] += nx * ny
        H[0, 2] += nx * turn
        H[1, 1] += ny * ny
        H[1, 2] += ny * turn
        H[2, 2] += turn * turn
    H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]
    A = inverse3(H)
    for i in range(m):
        nx, ny = normals[0, i], normals[1, i]
        turn = ny * points[0, i] - nx * points[1, i]
        share = A[0, 0] * nx * nx + A[1, 1] * ny * ny + A[2, 2] * turn * turn
        out[i] = share + 2.0 * (A[0, 1] * nx * ny + (A[0, 2] * nx + A[1, 2] * ny) * turn)


@njit
def critical_rays(
    points: Points,
    normals: Points,
    moments: Floats,
    m: int,
    laser: Pose2,
    count: int,
    H: Floats,
    out: Floats,
) -> int:
    """About `count` of m points that carry the pose, into out (m, 2), x, y [m]; how many.

    [Tsardoulias13]: those at discontinuities, and of the rest the far ones more densely. ours: half
    of the rest goes to those with the greatest share in x, y and theta; chosen by error diffusion
    along the scan, without a draw. moments as of `scan_moments`; H as of `leverage`.
    """
    room = np.empty((3, m))
    shares, edge, far = room[0], room[1], room[2]
    for i in range(m):
        edge[i] = 0.0
    for i in range(m):
        far[i] = math.sqrt((points[0, i] - laser.x) ** 2 + (points[1, i] - laser.y) ** 2)
        if moments[5, i + 1] != moments[5, i]:
            edge[i] = edge[min(i + 1, m - 1)] = 1.0
    leverage(points, normals, m, H, shares)
    edges = all_far = all_shares = 0.0
    for i in range(m):
        edges += edge[i]
        all_far += far[i]
        all_shares += shares[i]
    each = min(EDGES * count / max(edges, 1.0), 1.0)
    rest = 0.5 * (count - each * edges)
    scale = 1.0 / max(all_shares, LEAST)
    k, owed = 0, 0.0
    for i in range(m):
        owed += min(each * edge[i] + rest * (shares[i] * scale + far[i] / all_far), 1.0)
        if owed >= 1.0 or m <= count:
            owed -= 1.0
            out[k, 0], out[k, 1] = points[0, i], points[1, i]
            k += 1
    return k
