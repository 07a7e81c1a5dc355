"""Walls that are of glass from place to place."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bench.sim.degrade.degradation import degradation
from bench.sim.rays import ends_of, rays_of, true_poses
from slams.scanlog import ScanLog
from slams.types import Floats, Ranges

if TYPE_CHECKING:
    from numpy.random import Generator

BLOCK = 200  # scans at once
PANE = 1.0  # m, edge of a place that is glass as a whole
PERIOD = 256  # places after which the draws repeat
TILT = (math.pi / 8.0, 3.0 * math.pi / 8.0)  # rad, of the places against walls along x and y
MIRROR = math.radians(8.0)  # incidence up to which a pane throws the light straight back
SPAN = math.radians(3.0)  # to either side of a beam: where its wall's direction is read


@degradation("%", (20, 40, 60, 80, 100), 0, 100, needs=("truth",))
def glass(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Of the walls, in panes of about 1 m.

    A place is glass from wherever it is seen. A beam that meets it sees nothing (inf: what lies
    behind is not in the log), unless it meets it within 8 deg of the perpendicular.
    """
    places = _Places(rng)
    ranges = np.array(log.ranges)
    for start in range(0, len(log), BLOCK):
        block = slice(start, start + BLOCK)
        rays = rays_of(log.laser, true_poses(log, log.t[block]))
        seen = np.where(np.isfinite(log.ranges[block]), log.ranges[block], np.nan)
        ends = ends_of(rays, seen)
        through = places.chance(ends) < 0.01 * level
        through &= _incidence(log.ranges[block], log.laser.angle_increment) > MIRROR
        ranges[block][through] = np.inf
    return replace(log, ranges=ranges)


class _Places:
    """A grid of squares, askew to the walls so that none lies along a border, each with a draw."""

    def __init__(self, rng: Generator) -> None:
        tilt = float(rng.uniform(*TILT))
        self.axes = np.array([[math.cos(tilt), -math.sin(tilt)], [math.sin(tilt), math.cos(tilt)]])
        self.draws = rng.random((PERIOD, PERIOD))

    def chance(self, points: Floats) -> Floats:
        """The draw (...) in [0, 1) of the place of each point (..., 2) [m]; 1 where not finite."""
        known = np.isfinite(points).all(axis=-1)
        cells = np.floor(points[known] @ self.axes / PANE).astype(np.int64) % PERIOD
        chance = np.ones(points.shape[:-1])
        chance[known] = self.draws[cells[:, 0], cells[:, 1]]
        return chance


def _incidence(ranges: Ranges, increment: float) -> Floats:
    """Angle (n, b) [rad] between each beam and the perpendicular of what it meets.

    By the chord between the beams on either side; a right angle where these saw nothing.
    """
    n_beams = ranges.shape[1]
    here = np.arange(n_beams)
    reach = math.ceil(SPAN / abs(increment)) if increment else 0
    before, after = np.maximum(here - reach, 0), np.minimum(here + reach, n_beams - 1)
    a, b = ranges[:, before].astype(np.float64), ranges[:, after].astype(np.float64)
    turn_a, turn_b = (before - here) * increment, (after - here) * increment
    with np.errstate(invalid="ignore"):
        along = b * np.cos(turn_b) - a * np.cos(turn_a)
        across = b * np.sin(turn_b) - a * np.sin(turn_a)
        angle: NDArray[np.float64] = np.arctan2(np.abs(along), np.abs(across))
    return np.where(np.isfinite(angle) & (before < after), angle, 0.5 * math.pi)
