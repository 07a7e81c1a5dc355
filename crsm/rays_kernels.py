"""Critical rays: the beams of a scan that constrain x, y and theta."""

from __future__ import annotations

import math

import numpy as np

from slams.geometry import inverse3
from slams.jit import njit
from slams.scan.scan_kernels import Points
from slams.types import Floats, Pose2

MAX_DISCONTINUITY_SHARE = 0.25  # of the rays, at discontinuities of the range
REGULARIZATION = 1e-6  # 1 and m^2, on the diagonal of H; so that it has an inverse


@njit
def leverage(points: Points, normals: Points, m: int, H: Floats, out: Floats) -> None:
    """Leverage (m,) of each point in the fit of the pose, c' H^-1 c; their sum is 3.

    ours: a standard measure of how much one point constrains the pose. c is the normal nx, ny and
    its lever arm; H (3, 3) the sum of c c' [1, m, m^2]. An isolated point has no normal: 0.
    """
    for i in range(3):
        for k in range(3):
            H[i, k] = REGULARIZATION if i == k else 0.0
    for i in range(m):
        nx, ny = normals[0, i], normals[1, i]
        lever = ny * points[0, i] - nx * points[1, i]
        H[0, 0] += nx * nx
        H[0, 1] += nx * ny
        H[0, 2] += nx * lever
        H[1, 1] += ny * ny
        H[1, 2] += ny * lever
        H[2, 2] += lever * lever
    H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]
    A = inverse3(H)
    for i in range(m):
        nx, ny = normals[0, i], normals[1, i]
        lever = ny * points[0, i] - nx * points[1, i]
        squares = A[0, 0] * nx * nx + A[1, 1] * ny * ny + A[2, 2] * lever * lever
        out[i] = squares + 2.0 * (A[0, 1] * nx * ny + (A[0, 2] * nx + A[1, 2] * ny) * lever)


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
    """Choose about `count` of m points into out (m, 2), x, y [m]; returns their number.

    [Tsardoulias13]: points at discontinuities, and more of the far points than of the near. ours:
    of the rays that discontinuities leave, half are chosen by leverage, half by range; by error
    diffusion along the scan, so without random numbers. moments of `scan_moments`; H of `leverage`.
    """
    scratch = np.empty((3, m))
    leverages, at_jump, ranges = scratch[0], scratch[1], scratch[2]
    for i in range(m):
        at_jump[i] = 0.0
    for i in range(m):
        ranges[i] = math.sqrt((points[0, i] - laser.x) ** 2 + (points[1, i] - laser.y) ** 2)
        if moments[5, i + 1] != moments[5, i]:
            at_jump[i] = at_jump[min(i + 1, m - 1)] = 1.0
    leverage(points, normals, m, H, leverages)
    jumps = total_range = total_leverage = 0.0
    for i in range(m):
        jumps += at_jump[i]
        total_range += ranges[i]
        total_leverage += leverages[i]
    each = min(MAX_DISCONTINUITY_SHARE * count / max(jumps, 1.0), 1.0)
    rest = 0.5 * (count - each * jumps)
    scale = 1.0 / max(total_leverage, REGULARIZATION)
    k, error = 0, 0.0
    for i in range(m):
        share = leverages[i] * scale + ranges[i] / total_range
        error += min(each * at_jump[i] + rest * share, 1.0)
        if error >= 1.0 or m <= count:
            error -= 1.0
            out[k, 0], out[k, 1] = points[0, i], points[1, i]
            k += 1
    return k
