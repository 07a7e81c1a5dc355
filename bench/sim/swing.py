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


def ranges_of(walls: Floats, along: Floats, slope: Floats, height: Floats | float) -> Floats:
    """Ranges [m] along tilted beams, of distances to walls over ground: these, or the floor.

    inf where a beam passes above the wall. `height` [m] of the laser above the floor.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = walls / along
        floor = np.where(slope < 0.0, -height / slope, np.inf)
        ranges[ranges * slope > WALLS - height] = np.inf
    found: Floats = np.minimum(ranges, floor)
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
