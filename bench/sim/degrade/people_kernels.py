"""Paths of people who stay near a robot."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from slams.jit import njit
from slams.types import Floats, Ranges

if TYPE_CHECKING:
    from numpy.random import Generator

MAX_GOAL_DISTANCE = 3.0  # m from the laser
GOAL_CLEARANCE = 0.3  # m from a goal to the wall behind it
MAX_PERSON_DISTANCE = 5.0  # m from the laser; beyond, a new person replaces this one


@njit(inner=True)
def _goal(
    sensor: Floats, ranges: Ranges, angles: Floats, nearest: float, rng: Generator
) -> tuple[float, float]:
    """A random place (x, y) that the laser at sensor (3,) observes, `nearest` to 3 m away. ours."""
    beam = math.floor(rng.random() * len(ranges))
    farthest = MAX_GOAL_DISTANCE
    if ranges[beam] - GOAL_CLEARANCE < farthest:  # false for nan
        farthest = ranges[beam] - GOAL_CLEARANCE
    distance = max(nearest, nearest + rng.random() * (farthest - nearest))
    heading = sensor[2] + angles[beam]
    return sensor[0] + distance * math.cos(heading), sensor[1] + distance * math.sin(heading)


@njit
def stroll(
    sensors: Floats,
    ranges: Ranges,
    angles: Floats,
    strides: Floats,
    nearest: float,
    rng: Generator,
    out: Floats,
) -> None:
    """Fill out (n, 2) [m] with the positions of a person at each scan of a laser at sensors (n, 3).

    ours: straight from goal to goal, each an observed place by ranges (n, b) at angles (b,), at
    least `nearest` [m] from the laser. `strides` (n,) [m] are the distances walked before each
    scan. A person far from the robot is replaced by another one.
    """
    x, y = _goal(sensors[0], ranges[0], angles, nearest, rng)
    gx, gy = x, y
    for i in range(len(out)):
        sx, sy = sensors[i, 0], sensors[i, 1]
        if math.hypot(x - sx, y - sy) > MAX_PERSON_DISTANCE:
            x, y = _goal(sensors[i], ranges[i], angles, nearest, rng)
        remaining = math.hypot(gx - x, gy - y)
        if remaining <= strides[i] or math.hypot(gx - sx, gy - sy) > MAX_PERSON_DISTANCE:
            gx, gy = _goal(sensors[i], ranges[i], angles, nearest, rng)
            remaining = math.hypot(gx - x, gy - y)
        if remaining > 0.0:
            share = min(1.0, strides[i] / remaining)
            x += share * (gx - x)
            y += share * (gy - y)
        distance = math.hypot(x - sx, y - sy)
        if 0.0 < distance < nearest:
            x = sx + (x - sx) * nearest / distance
            y = sy + (y - sy) * nearest / distance
        out[i, 0], out[i, 1] = x, y
