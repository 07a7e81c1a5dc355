"""From ranges to points."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.jit import njit
from slams.types import Floats, Ranges


class Beams(NamedTuple):
    """How the ranges of one scan lie in the base frame.

    Mount x, y [m], theta [rad]; the motion x, y [m], theta [rad] of the base from one beam to the
    next; least and greatest range used [m].
    """

    x: float
    y: float
    theta: float
    sweep_x: float
    sweep_y: float
    sweep_theta: float
    near: float
    far: float


@njit
def end_points(ranges: Ranges, directions: Floats, beams: Beams, out: Floats) -> int:
    """End points [m] of the beams with a return, in the base frame.

    Original code; ours: for a laser that turns slowly every beam is moved by the way the base went
    since the first one. ranges (n,) m, directions (n, 2), out (>= n, 2); returns how many.
    """
    c, s = math.cos(beams.theta), math.sin(beams.theta)
    sweeps = beams.sweep_theta != 0.0 or beams.sweep_x != 0.0 or beams.sweep_y != 0.0
    n = 0
    for i in range(min(ranges.shape[0], directions.shape[0])):
        r = ranges[i]
        if not (r >= beams.near and r < beams.far):
            continue
        lx, ly = r * directions[i, 0], r * directions[i, 1]
        x, y = beams.x + c * lx - s * ly, beams.y + s * lx + c * ly
        if sweeps:
            ct, st = math.cos(i * beams.sweep_theta), math.sin(i * beams.sweep_theta)
            x, y = ct * x - st * y + i * beams.sweep_x, st * x + ct * y + i * beams.sweep_y
        out[n, 0], out[n, 1] = x, y
        n += 1
    return n
