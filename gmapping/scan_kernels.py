"""From end points to small pieces of surface."""

from __future__ import annotations

import math

from slams.jit import njit
from slams.scan.scan_kernels import Points
from slams.types import Floats, Pose2

GRAZING = 0.1  # cosine between beam and normal; walls seen more edge-on say nothing
STEP = 0.12  # m that ranges differ by from one thing to the next


@njit(inner=True, borrows=True)
def is_post(points: Points, n: int, i: int, mount: Pose2, far: float) -> bool:
    """Whether more of the beams beside an end point `far` [m] away are farther than are nearer.

    ours: what has no neighbors on a wall seen edge-on lies between a nearer one and a farther one,
    or at the far end of a corridor, behind both.
    """
    farther = 0
    for k in (i - 1, i + 1):
        if 0 <= k < n:
            beyond = math.hypot(points[0, k] - mount.x, points[1, k] - mount.y) - far
            farther += int(beyond > STEP) - int(beyond < -STEP)
    return farther > 0


@njit
def pieces(points: Points, normals: Points, n: int, mount: Pose2, grain: float, out: Floats) -> int:
    """Beams that end within `grain` [m] of each other become one piece of surface.

    ours: their mean and the mean of their normals, toward the laser. A piece without normals looks
    at the laser: a post, or the frame of a door, tells along a corridor what its walls do not. What
    is seen edge-on is left out. points, normals (2 or 3, >= n) of `EndPoints`; out (>= n, 5) rows
    x, y [m], nx, ny, how many beams; returns how many.
    """
    count, i = 0, 0
    while i < n:
        first, x, y, nx, ny, beams = i, 0.0, 0.0, 0.0, 0.0, 0
        while i < n:
            dx, dy = points[0, i] - points[0, first], points[1, i] - points[1, first]
            if beams > 0 and dx * dx + dy * dy >= grain * grain:
                break
            x, y, beams = x + dx, y + dy, beams + 1
            nx, ny = nx + normals[0, i], ny + normals[1, i]
            i += 1
        x, y = points[0, first] + x / beams, points[1, first] + y / beams
        bx, by = mount.x - x, mount.y - y
        far, length = math.hypot(bx, by), math.hypot(nx, ny)
        if far == 0.0:
            continue
        if length > 0.0:
            nx, ny = nx / length, ny / length
            if nx * bx + ny * by < GRAZING * far:
                continue
        else:
            if beams == 1 and not is_post(points, n, first, mount, far):
                continue
            nx, ny = bx / far, by / far
        out[count, 0], out[count, 1], out[count, 2], out[count, 3] = x, y, nx, ny
        out[count, 4] = beams
        count += 1
    return count
