"""A robot that follows a way under limits of speed and acceleration."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.geometry import wrap_angle
from slams.jit import njit
from slams.types import Floats


class Limits(NamedTuple):
    """What the robot can do: turn rate [rad/s], accelerations [m/s^2, rad/s^2], look-ahead [m]."""

    w: float
    dv: float
    dw: float
    look_ahead: float


@njit
def _approach(value: float, target: float, step: float) -> float:
    """`value` moved towards `target` by at most `step`. ours."""
    return min(max(target, value - step), value + step)


@njit
def follow(way: Floats, pace: Floats, limits: Limits, dt: float, out: Floats) -> None:
    """Drive along way (m, 2) [m] from rest; fills out (n, 5) with x, y, theta, v, w every dt [s].

    ours: the robot heads for a carrot, the first point of the way not yet within the look-ahead,
    turns on the spot when that lies aside, and stops near the end. `pace` (m,) [m/s] is the
    greatest speed at each point. Each step is an exact arc of constant v and w.
    """
    last, carrot = len(way) - 1, 0
    x, y = way[0, 0], way[0, 1]
    theta = math.atan2(way[1, 1] - y, way[1, 0] - x)
    v = w = 0.0
    for i in range(len(out)):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4] = x, y, theta, v, w
        dx, dy = way[carrot, 0] - x, way[carrot, 1] - y
        while math.hypot(dx, dy) < limits.look_ahead and carrot < last:
            carrot += 1
            dx, dy = way[carrot, 0] - x, way[carrot, 1] - y
        v_wanted = w_wanted = 0.0
        if carrot < last:
            aside = wrap_angle(math.atan2(dy, dx) - theta)
            # the rate from which the robot can still stop turning in time, softened near zero
            turn = min(limits.w, math.sqrt(limits.dw * abs(aside)), 2.5 * abs(aside))
            w_wanted = math.copysign(turn, aside)
            v_wanted = pace[carrot] * max(0.0, math.cos(min(1.5 * abs(aside), 0.5 * math.pi)))
        v = _approach(v, v_wanted, limits.dv * dt)
        w = _approach(w, w_wanted, limits.dw * dt)
        half = 0.5 * w * dt
        chord = v * dt * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
        x += chord * math.cos(theta + half)
        y += chord * math.sin(theta + half)
        theta += w * dt
