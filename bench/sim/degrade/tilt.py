"""A body that rolls and pitches, with and without a measured attitude."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.degrade.degradation import degradation
from bench.sim.degrade.spells import elapsed
from bench.sim.rays import SCANS_PER_BLOCK
from bench.sim.swing import LASER_HEIGHT, Swing, level_floor, measured, ranges_of, rise
from slams.scanlog import ScanLog, TimeSeries
from slams.types import Floats, Laser, Ranges

if TYPE_CHECKING:
    from numpy.random import Generator

FLOOR_NOISE = 0.01  # m, standard deviation of a range to the floor
MAX_NEIGHBOR_DIFFERENCE = 0.3  # of the range, between neighbors on one surface


@degradation("deg", (3, 6, 10, 15, 25), 0, 40)
def tilt(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Maximum roll and pitch, laser 0.35 m above the floor; attitude measured to 0.3 deg."""
    tilted, attitudes = _tilted(log, level, rng)
    return replace(tilted, attitude=TimeSeries(log.t, measured(attitudes, elapsed(log.t), rng)))


@degradation("deg", (3, 6, 10, 15, 25), 0, 40)
def tilt_unmeasured(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Maximum roll and pitch, laser 0.35 m above the floor; attitude not measured."""
    return replace(_tilted(log, level, rng)[0], attitude=None)


def _tilted(log: ScanLog, level: float, rng: Generator) -> tuple[ScanLog, Floats]:
    """The log of a laser that tilts about itself, and its true attitudes (n, 2)."""
    laser, clock, swing = log.laser, elapsed(log.t), Swing(level, rng)
    delays = laser.time_increment * np.arange(laser.n_beams)
    ranges = np.array(log.ranges)
    noise = rng.spawn(1)[0]
    for start in range(0, len(log), SCANS_PER_BLOCK):
        block = slice(start, start + SCANS_PER_BLOCK)
        attitudes = swing.at(clock[block, None] + delays)
        ranges[block] = _tilted_ranges(log.ranges[block], laser, attitudes, noise)
    high = replace(laser, mount_z=0.0, height=LASER_HEIGHT)
    return replace(log, ranges=ranges, laser=high), swing.at(clock)


def _tilted_ranges(ranges: Ranges, laser: Laser, attitudes: Floats, rng: Generator) -> Floats:
    """Ranges (n, b) of tilted beams, from those of level beams."""
    angles = laser.angles + laser.mount.theta
    directions = np.broadcast_to(
        np.stack([np.cos(angles), np.sin(angles)], axis=1), (*ranges.shape, 2)
    )
    along, rotation, slope = rise(directions, attitudes)
    walls = _between(ranges.astype(np.float64), rotation / (laser.angle_increment or 1.0))
    floor = level_floor(slope / along, LASER_HEIGHT)
    found = ranges_of(walls, floor, along, slope, LASER_HEIGHT)
    on_floor = found < walls / along
    return np.asarray(found + on_floor * rng.normal(0.0, FLOOR_NOISE, found.shape))


def _between(ranges: Floats, shift: Floats) -> Floats:
    """Ranges (n, b) interpolated at a shift (n, b) [beams], on the line between two end points.

    Between surfaces and beyond the fan, the nearest beam's range. 1 / r is linear along a wall.
    """
    n_beams = ranges.shape[1]
    place = np.clip(np.arange(n_beams) + shift, 0.0, n_beams - 1.0)
    first = np.minimum(place.astype(np.intp), max(n_beams - 2, 0))
    part, rows = place - first, np.arange(len(ranges))[:, None]
    a, b = ranges[rows, first], ranges[rows, np.minimum(first + 1, n_beams - 1)]
    nearest = np.where(part < 0.5, a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        line = 1.0 / ((1.0 - part) / a + part / b)
        same_surface = np.abs(a - b) < MAX_NEIGHBOR_DIFFERENCE * np.minimum(a, b)
    return np.where(same_surface & (part > 0.0), line, nearest)
