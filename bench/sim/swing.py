"""How a body rolls and pitches, and what its laser meets then: walls, the floor, or nothing."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.wheels import wander
from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator

HEIGHT, WALLS = 0.35, 1.2  # m above the floor: the laser, and the top of every wall
PERIODS = (2.5, 6.0)  # s in which a body rolls and pitches that climbs over rubble
ERROR, MEMORY = math.radians(0.3), 2.0  # rad, s: of an attitude reference, and how long it lasts


class Swing:
    """Roll and pitch as two sines of periods and phases by chance."""

    def __init__(self, level: float, rng: Generator) -> None:
        self.most = math.radians(level)
        self.rates = 2.0 * math.pi / rng.uniform(*PERIODS, 2)
        self.phases = rng.uniform(0.0, 2.0 * math.pi, 2)

    def stand(self, t: Floats, poses: Floats) -> tuple[Floats, float]:
        """Roll and pitch (m, 2) [rad] at times t (m,) [s]; the base stays on a level floor."""
        return self.at(t), 0.0

    def meet(self, rays: Floats, walls: Floats, rise: Floats, height: Floats) -> Floats:
        """Distances (m,) [m] over ground to the floor, inf where a beam does not meet it.

        Along rays that start so high [m] and rise so much (m,) for each meter over ground.
        """
        return level_floor(rise, height)

    def at(self, t: Floats) -> Floats:
        """Roll and pitch (..., 2) [rad] at times t (...) [s] of a drive."""
        attitudes: Floats = self.most * np.sin(self.rates * t[..., None] + self.phases)
        return attitudes


def rise(directions: Floats, attitudes: Floats) -> tuple[Floats, Floats, Floats]:
    """Where beams of a tilted body point to: length over ground, turn to the left, slope (...).

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
    """Roll and pitch (n, 2) [rad] at times t (n,) [s] as an attitude reference gives them."""
    dt = np.diff(t, prepend=t[0])
    errors = [wander(dt, ERROR, MEMORY, rng) for _ in ("roll", "pitch")]
    return attitudes + np.stack(errors, axis=1)


def level_floor(rise: Floats, height: Floats | float) -> Floats:
    """Distances [m] over ground at which beams meet a level floor, inf where they do not."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(rise < 0.0, -height / rise, np.inf)


def ranges_of(
    walls: Floats, floor: Floats, along: Floats, slope: Floats, height: Floats | float
) -> Floats:
    """Ranges [m] along tilted beams, of distances over ground to walls and to the floor.

    inf where a beam passes above the wall. `height` [m] of the laser above the lowest floor.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = walls / along
        ranges[ranges * slope > WALLS - height] = np.inf
        found: Floats = np.minimum(ranges, floor / along)
    return found


def sway(rays: Floats, attitudes: Floats) -> Floats:
    """Move starts (m, 3) from the base on the floor to the laser above it, in place.

    The body tilts about the base. Returns the laser's height above the floor (m,) [m].
    """
    (cr, cp), (sr, sp) = np.cos(attitudes).T, np.sin(attitudes).T
    ahead, aside = HEIGHT * sp * cr, -HEIGHT * sr
    c, s = np.cos(rays[:, 2]), np.sin(rays[:, 2])
    rays[:, 0] += c * ahead - s * aside
    rays[:, 1] += s * ahead + c * aside
    height: Floats = HEIGHT * cp * cr
    return height
