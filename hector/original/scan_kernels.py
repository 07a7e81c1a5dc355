"""Kernels of the scan: end points and their deskewing."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats, Pose2, Ranges

Points = NDArray[np.float64]


class Limits(NamedTuple):
    """Ranges [m] that are used: from `near` to `far`, behind the laser from `body`."""

    near: float
    far: float
    body: float


class Twist(NamedTuple):
    """Motion of the base during a sweep: vx, vy [m/s], rotation rate [rad/s], time per beam [s]."""

    vx: float
    vy: float
    rate: float
    time_increment: float


@njit
def end_points(
    ranges: Ranges, directions: Floats, mount: Pose2, limits: Limits, out: Points
) -> int:
    """End points in the base frame: [Kohlbrecher11] sec. IV-A; returns their number.

    Original code: the filters by range. ranges (b,) [m], directions (b, 2) in the laser frame,
    out (3, b): x, y [m], number of the beam.
    """
    c, s = math.cos(mount.theta), math.sin(mount.theta)
    n = 0
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if not (limits.near < r < limits.far):
            continue
        x, y = r * directions[i, 0], r * directions[i, 1]
        if x < 0.0 and r < limits.body:
            continue
        x, y = mount.x + c * x - s * y, mount.y + s * x + c * y
        out[0, n] = x
        out[1, n] = y
        out[2, n] = i
        n += 1
    return n


@njit
def deskew(points: Points, n: int, twist: Twist) -> None:
    """Deskew: transform end points to the base frame at the time of the first beam, in place.

    ours, only in presets of spinning lasers: the program ignores the motion during a sweep. points
    (3, >= n) of `end_points`; the base moves on an arc, whose chord has half of the rotation.
    """
    for i in range(n):
        t = points[2, i] * twist.time_increment
        rotation = twist.rate * t
        c, s = math.cos(rotation), math.sin(rotation)
        ch, sh = math.cos(0.5 * rotation), math.sin(0.5 * rotation)
        x, y, vx, vy = points[0, i], points[1, i], twist.vx * t, twist.vy * t
        points[0, i] = c * x - s * y + ch * vx - sh * vy
        points[1, i] = s * x + c * y + sh * vx + ch * vy
