"""Kernel that merges end points into small pieces of surface."""

from __future__ import annotations

import math

from slams.jit import njit
from slams.scan.scan_kernels import Points
from slams.types import Floats, Pose2

MIN_INCIDENCE_COSINE = 0.1  # between beam and normal; hits on a wall seen edge-on are left out
MIN_RANGE_STEP = 0.12  # m between the ranges of neighboring beams on two separate objects


@njit(inner=True, borrows=True)
def is_post(points: Points, n: int, i: int, mount: Pose2, far: float) -> bool:
    """Whether an isolated end point at range `far` [m] stands in front of its neighbors, as a post.

    ours: an isolated point on a wall seen edge-on lies between a nearer and a farther neighbor; at
    the far end of a corridor it lies behind both.
    """
    farther = 0
    for k in (i - 1, i + 1):
        if 0 <= k < n:
            beyond = math.hypot(points[0, k] - mount.x, points[1, k] - mount.y) - far
            farther += int(beyond > MIN_RANGE_STEP) - int(beyond < -MIN_RANGE_STEP)
    return farther > 0


@njit
def pieces(points: Points, normals: Points, n: int, mount: Pose2, grain: float, out: Floats) -> int:
    """Merge beams that end within `grain` [m] of each other into one piece of surface.

    ours: a piece has the mean of its end points and normals. A piece without normals faces the
    laser: a post or a door frame constrains the position along a corridor. A piece seen edge-on is
    left out. points (4, >= n), normals (2, >= n) as in `EndPoints`; out (>= n, 5) rows x, y [m],
    nx, ny, sum of the weights of its beams; returns the number of pieces.
    """
    count, i = 0, 0
    while i < n:
        first, x, y, nx, ny, beams, weight = i, 0.0, 0.0, 0.0, 0.0, 0, 0.0
        while i < n:
            dx, dy = points[0, i] - points[0, first], points[1, i] - points[1, first]
            if beams > 0 and dx * dx + dy * dy >= grain * grain:
                break
            x, y, beams, weight = x + dx, y + dy, beams + 1, weight + points[3, i]
            nx, ny = nx + normals[0, i], ny + normals[1, i]
            i += 1
        x, y = points[0, first] + x / beams, points[1, first] + y / beams
        bx, by = mount.x - x, mount.y - y
        far, length = math.hypot(bx, by), math.hypot(nx, ny)
        if far == 0.0:
            continue
        if length > 0.0:
            nx, ny = nx / length, ny / length
            if nx * bx + ny * by < MIN_INCIDENCE_COSINE * far:
                continue
        else:
            if beams == 1 and not is_post(points, n, first, mount, far):
                continue
            nx, ny = bx / far, by / far
        out[count, 0], out[count, 1], out[count, 2], out[count, 3] = x, y, nx, ny
        out[count, 4] = weight
        count += 1
    return count
