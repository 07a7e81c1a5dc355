"""Roll and pitch of a body, and ranges of its tilted laser to walls and floor."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.wheels import wander
from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator

LASER_HEIGHT, WALL_HEIGHT = 0.35, 1.2  # m above the floor
SWING_PERIODS = (2.5, 6.0)  # s, of a body that climbs over rubble
ATTITUDE_ERROR = math.radians(0.3)  # rad, deviation of an attitude reference
ATTITUDE_ERROR_TIME = 2.0  # s, correlation time of this error


class Swing:
    """Roll and pitch as two sines with random periods and phases."""

    def __init__(self, level: float, rng: Generator) -> None:
        self.amplitude = math.radians(level)
        self.rates = 2.0 * math.pi / rng.uniform(*SWING_PERIODS, 2)
        self.phases = rng.uniform(0.0, 2.0 * math.pi, 2)

    def stand(self, t: Floats, poses: Floats) -> tuple[Floats, float]:
        """Roll and pitch (m, 2) [rad] at times t (m,) [s]; the base stays on a level floor."""
        return self.at(t), 0.0

    def meet(self, rays: Floats, walls: Floats, rise: Floats, height: Floats) -> Floats:
        """Horizontal distances (m,) [m] to the floor, inf where a beam does not meet it.

        The rays start at `height` [m] and rise by `rise` (m,) for each horizontal meter.
        """
        return level_floor(rise, height)

    def at(self, t: Floats) -> Floats:
        """Roll and pitch (..., 2) [rad] at times t (...) [s] of a drive."""
        attitudes: Floats = self.amplitude * np.sin(self.rates * t[..., None] + self.phases)
        return attitudes


def rise(directions: Floats, attitudes: Floats) -> tuple[Floats, Floats, Floats]:
    """Directions of a tilted body's beams: horizontal length, rotation to the left, slope (...).

    `directions` (..., 2) unit vectors in the base frame, `attitudes` (..., 2) roll, pitch [rad].
    """
    x, y = directions[..., 0], directions[..., 1]
    (cr, cp), (sr, sp) = (
        np.moveaxis(np.cos(attitudes), -1, 0),
        np.moveaxis(np.sin(attitudes), -1, 0),
    )
    u, v, w = cp * x + sp * sr * y, cr * y, cp * sr * y - sp * x
    return np.hypot(u, v), np.arctan2(x * v - y * u, x * u + y * v), w


def measured(attitudes: Floats, t: Floats, rng: Generator) -> Floats:
    """Roll and pitch (n, 2) [rad] at times t (n,) [s] as measured by an attitude reference."""
    dt = np.diff(t, prepend=t[0])
    errors = [wander(dt, ATTITUDE_ERROR, ATTITUDE_ERROR_TIME, rng) for _ in ("roll", "pitch")]
    return attitudes + np.stack(errors, axis=1)


def level_floor(rise: Floats, height: Floats | float) -> Floats:
    """Horizontal distances [m] at which beams meet a level floor, inf where they do not."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(rise < 0.0, -height / rise, np.inf)


def ranges_of(
    walls: Floats, floor: Floats, along: Floats, slope: Floats, height: Floats | float
) -> Floats:
    """Ranges [m] along tilted beams, from horizontal distances to walls and floor.

    inf where a beam passes above the wall. `height` [m] of the laser above the lowest floor.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = walls / along
        ranges[ranges * slope > WALL_HEIGHT - height] = np.inf
        found: Floats = np.minimum(ranges, floor / along)
    return found


def sway(rays: Floats, attitudes: Floats) -> Floats:
    """Move starts (m, 3) from the base on the floor to the laser above it, in place.

    The body tilts about the base. Returns the laser's height above the floor (m,) [m].
    """
    (cr, cp), (sr, sp) = np.cos(attitudes).T, np.sin(attitudes).T
    longitudinal, lateral = LASER_HEIGHT * sp * cr, -LASER_HEIGHT * sr
    c, s = np.cos(rays[:, 2]), np.sin(rays[:, 2])
    rays[:, 0] += c * longitudinal - s * lateral
    rays[:, 1] += s * longitudinal + c * lateral
    height: Floats = LASER_HEIGHT * cp * cr
    return height
