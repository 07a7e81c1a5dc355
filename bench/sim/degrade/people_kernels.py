"""Where somebody walks who keeps near a robot."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from slams.jit import njit
from slams.types import Floats, Ranges

if TYPE_CHECKING:
    from numpy.random import Generator

NEAR = 3.0  # m from the laser: the farthest goal
WALL = 0.3  # m, kept from what the laser sees behind a goal
LEFT_BEHIND = 5.0  # m from the laser: somebody else comes into view instead


@njit(inner=True)
def _goal(
    sensor: Floats, ranges: Ranges, angles: Floats, least: float, rng: Generator
) -> tuple[float, float]:
    """A place (x, y) that the laser at sensor (3,) sees, `least` to 3 m away. ours: by chance."""
    beam = math.floor(rng.random() * len(ranges))
    most = NEAR
    if ranges[beam] - WALL < most:  # nan is not
        most = ranges[beam] - WALL
    far = max(least, least + rng.random() * (most - least))
    heading = sensor[2] + angles[beam]
    return sensor[0] + far * math.cos(heading), sensor[1] + far * math.sin(heading)


@njit
def stroll(
    sensors: Floats,
    ranges: Ranges,
    angles: Floats,
    strides: Floats,
    least: float,
    rng: Generator,
    out: Floats,
) -> None:
    """Fill out (n, 2) [m] with where somebody is at each scan of a laser at sensors (n, 3).

    ours: straight from goal to goal, each a place that the laser reaches by the readings ranges
    (n, b) at angles (b,), stepping aside to keep `least` [m] off. `strides` (n,) [m] is how far
    they get up to each scan. Whom the robot leaves behind goes home, and another comes.
    """
    x, y = _goal(sensors[0], ranges[0], angles, least, rng)
    gx, gy = x, y
    for i in range(len(out)):
        sx, sy = sensors[i, 0], sensors[i, 1]
        if math.hypot(x - sx, y - sy) > LEFT_BEHIND:
            x, y = _goal(sensors[i], ranges[i], angles, least, rng)
        left = math.hypot(gx - x, gy - y)
        if left <= strides[i] or math.hypot(gx - sx, gy - sy) > LEFT_BEHIND:
            gx, gy = _goal(sensors[i], ranges[i], angles, least, rng)
            left = math.hypot(gx - x, gy - y)
        if left > 0.0:
            share = min(1.0, strides[i] / left)
            x += share * (gx - x)
            y += share * (gy - y)
        away = math.hypot(x - sx, y - sy)
        if 0.0 < away < least:
            x = sx + (x - sx) * least / away
            y = sy + (y - sy) * least / away
        out[i, 0], out[i, 1] = x, y
