"""A body that rolls and pitches under its laser, with and without an attitude that says so."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.degrade.degradation import degradation
from bench.sim.degrade.spells import elapsed
from bench.sim.swing import HEIGHT, Swing, level_floor, measured, ranges_of, rise
from slams.scanlog import ScanLog, TimeSeries
from slams.types import Floats, Laser, Ranges

if TYPE_CHECKING:
    from numpy.random import Generator

BLOCK = 200  # scans at once
FLOOR_NOISE = 0.01  # m, standard deviation of a range to the floor
EDGE = 0.3  # share by which ranges of neighbors differ that meet two things


@degradation("deg", (3, 6, 10, 15, 25), 0, 40)
def tilt(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Roll and pitch of up to that much each, laser 0.35 m above the floor; measured to 0.3 deg."""
    tilted, attitudes = _tilted(log, level, rng)
    return replace(tilted, attitude=TimeSeries(log.t, measured(attitudes, elapsed(log.t), rng)))


@degradation("deg", (3, 6, 10, 15, 25), 0, 40)
def tilt_unmeasured(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Roll and pitch of up to that much each, laser 0.35 m above the floor; nothing measures it."""
    return replace(_tilted(log, level, rng)[0], attitude=None)


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
    floor = level_floor(slope / along, HEIGHT)
    found = ranges_of(walls, floor, along, slope, HEIGHT)
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
