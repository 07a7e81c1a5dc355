"""A body that rolls and pitches under its laser, with and without an attitude that says so."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.degrade.degradation import Degradation
from bench.sim.degrade.spells import elapsed
from bench.sim.wheels import wander
from slams.scanlog import ScanLog, Track
from slams.types import Floats, Laser, Ranges

if TYPE_CHECKING:
    from numpy.random import Generator

BLOCK = 200  # scans at once
HEIGHT, WALLS = 0.35, 1.2  # m above the floor: the laser, and the top of every wall
PERIODS = (2.5, 6.0)  # s in which a body rolls and pitches that climbs over rubble
ERROR, MEMORY = math.radians(0.3), 2.0  # rad, s: of an attitude reference, and how long it lasts
FLOOR_NOISE = 0.01  # m, standard deviation of a range to the floor
EDGE = 0.3  # share by which ranges of neighbors differ that meet two things


def tilt(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Roll and pitch of up to `level` [deg] each about the laser; measured, to 0.3 deg."""
    tilted, attitudes = _tilted(log, level, rng)
    dt = np.diff(elapsed(log.t), prepend=0.0)
    errors = [wander(dt, ERROR, MEMORY, rng) for _ in ("roll", "pitch")]
    return replace(tilted, attitude=Track(log.t, attitudes + np.stack(errors, axis=1)))


def tilt_unmeasured(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Roll and pitch of up to `level` [deg] each about the laser, and nothing that measures it."""
    return replace(_tilted(log, level, rng)[0], attitude=None)


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


def ranges_of(walls: Floats, along: Floats, slope: Floats, height: float) -> Floats:
    """Ranges [m] along tilted beams, of distances to walls over ground: these, or the floor.

    inf where a beam passes above the wall.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = walls / along
        floor = np.where(slope < 0.0, -height / slope, np.inf)
        ranges[ranges * slope > WALLS - height] = np.inf
    found: Floats = np.minimum(ranges, floor)
    return found


def _tilted(log: ScanLog, level: float, rng: Generator) -> tuple[ScanLog, Floats]:
    """The log as a laser sees it that tilts about itself, and its true attitudes (n, 2)."""
    laser, clock, swing = log.laser, elapsed(log.t), Swing(level, rng)
    delays = laser.time_increment * np.arange(laser.n_beams)
    ranges = np.array(log.ranges)
    noise = rng.spawn(1)[0]
    for start in range(0, len(log), BLOCK):
        block = slice(start, start + BLOCK)
        attitudes = swing.at(clock[block, None] + delays)
        ranges[block] = _seen(log.ranges[block], laser, attitudes, noise)
    high = replace(laser, mount_z=0.0, height=HEIGHT)
    return replace(log, ranges=ranges, laser=high), swing.at(clock)


def _seen(ranges: Ranges, laser: Laser, attitudes: Floats, rng: Generator) -> Floats:
    """Ranges (n, b) of tilted beams, from those of level ones."""
    angles = laser.angles + laser.mount.theta
    directions = np.broadcast_to(
        np.stack([np.cos(angles), np.sin(angles)], axis=1), (*ranges.shape, 2)
    )
    along, turn, slope = rise(directions, attitudes)
    walls = _between(ranges.astype(np.float64), turn / (laser.angle_increment or 1.0))
    found = ranges_of(walls, along, slope, HEIGHT)
    on_floor = found < walls / along
    return np.asarray(found + on_floor * rng.normal(0.0, FLOOR_NOISE, found.shape))


def _between(ranges: Floats, shift: Floats) -> Floats:
    """Ranges (n, b) so many beams (n, b) further on: on the line between two neighbors' ends.

    Between things and beside the fan that of the nearest beam; 1 / r is linear along a wall.
    """
    n_beams = ranges.shape[1]
    place = np.clip(np.arange(n_beams) + shift, 0.0, n_beams - 1.0)
    first = np.minimum(place.astype(np.intp), max(n_beams - 2, 0))
    part, rows = place - first, np.arange(len(ranges))[:, None]
    a, b = ranges[rows, first], ranges[rows, np.minimum(first + 1, n_beams - 1)]
    nearest = np.where(part < 0.5, a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        line = 1.0 / ((1.0 - part) / a + part / b)
        one = np.abs(a - b) < EDGE * np.minimum(a, b)
    return np.where(one & (part > 0.0), line, nearest)


LEVELS, FULL_LEVELS = (6, 15), (1, 3, 6, 10, 15)
MEANING = "roll and pitch of up to that much each, laser 0.35 m above the floor"
ENTRIES = (
    Degradation("tilt", "deg", f"{MEANING}; measured to 0.3 deg", LEVELS, FULL_LEVELS, tilt, 0, 40),
    Degradation(
        "tilt_unmeasured",
        "deg",
        f"{MEANING}; nothing measures it",
        (3, 6),
        FULL_LEVELS,
        tilt_unmeasured,
        0,
        40,
    ),
)
