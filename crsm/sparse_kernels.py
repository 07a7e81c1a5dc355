"""Normals where beams are far apart."""

from __future__ import annotations

import math

from slams.jit import njit
from slams.scan.scan_kernels import Points, beyond_chord
from slams.types import Pose2

SPARSE = 0.1  # m between such beams: closer ones meet one surface
BEND = 3.0  # deviations of the noise that the middle of three beams may lie off the others' chord


@njit
def sparse_normals(
    points: Points, n: int, mount: Pose2, step: float, noise: float, out: Points
) -> None:
    """Normals of end points whose beams, `step` [rad] apart, are more than `SPARSE` [m] apart.

    ours: the line of five beams far apart is mostly of several things, and says of a wall along
    the robot's way that it stands across it. Of the three beams before, around and behind each the
    straightest count, those in line but for `noise` [m] of the ranges; else it has no normal.
    points (3, >= n); out (3, >= n): normal toward the sensor (0, 0 where none), mean gap [m].
    """
    for i in range(n):
        rx, ry = points[0, i] - mount.x, points[1, i] - mount.y
        if step * math.hypot(rx, ry) < SPARSE:
            continue
        nx = ny = gap = 0.0
        least = BEND * noise
        for a in range(max(i - 2, 0), min(i, n - 3) + 1):
            bend = abs(beyond_chord(points, a, a + 1, a + 2, mount))
            if bend < least:
                dx, dy = points[0, a + 2] - points[0, a], points[1, a + 2] - points[1, a]
                length = math.hypot(dx, dy)
                side = -1.0 if dy * rx > dx * ry else 1.0
                nx, ny, gap, least = side * dy / length, -side * dx / length, 0.5 * length, bend
        out[0, i], out[1, i], out[2, i] = nx, ny, gap
