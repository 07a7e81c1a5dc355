"""A robot that follows a path with limited speed and acceleration."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.geometry import wrap_angle
from slams.jit import njit
from slams.types import Floats


class Limits(NamedTuple):
    """Turn rate [rad/s], accelerations [m/s^2, rad/s^2] and look-ahead [m] of the robot."""

    w: float
    dv: float
    dw: float
    look_ahead: float


@njit
def _approach(value: float, target: float, step: float) -> float:
    """`value` moved towards `target` by at most `step`. ours."""
    return min(max(target, value - step), value + step)


@njit
def follow(path: Floats, speed: Floats, limits: Limits, dt: float, out: Floats) -> None:
    """Follow path (m, 2) [m] from rest; fills out (n, 5) with x, y, theta, v, w every dt [s].

    ours: the robot heads for the first point of the path beyond the look-ahead, turns on the spot
    when this point lies to the side, and stops near the end. `speed` (m,) [m/s] is the maximum at
    each point. Each step is an exact arc of constant v and w.
    """
    last, target = len(path) - 1, 0
    x, y = path[0, 0], path[0, 1]
    theta = math.atan2(path[1, 1] - y, path[1, 0] - x)
    v = w = 0.0
    for i in range(len(out)):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4] = x, y, theta, v, w
        dx, dy = path[target, 0] - x, path[target, 1] - y
        while math.hypot(dx, dy) < limits.look_ahead and target < last:
            target += 1
            dx, dy = path[target, 0] - x, path[target, 1] - y
        v_wanted = w_wanted = 0.0
        if target < last:
            bearing = wrap_angle(math.atan2(dy, dx) - theta)
            # the rate from which the robot can stop turning in time, smooth near zero
            rate = min(limits.w, math.sqrt(limits.dw * abs(bearing)), 2.5 * abs(bearing))
            w_wanted = math.copysign(rate, bearing)
            v_wanted = speed[target] * max(0.0, math.cos(min(1.5 * abs(bearing), 0.5 * math.pi)))
        v = _approach(v, v_wanted, limits.dv * dt)
        w = _approach(w, w_wanted, limits.dw * dt)
        half = 0.5 * w * dt
        chord = v * dt * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
        x += chord * math.cos(theta + half)
        y += chord * math.sin(theta + half)
        theta += w * dt
