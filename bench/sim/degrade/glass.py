"""Walls of glass, in panes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bench.sim.degrade.degradation import degradation
from bench.sim.rays import SCANS_PER_BLOCK, ends_of, rays_of, true_poses
from slams.scanlog import ScanLog
from slams.types import Floats, Ranges

if TYPE_CHECKING:
    from numpy.random import Generator

PANE_SIZE = 1.0  # m
DRAW_PERIOD = 256  # panes after which the random draws repeat
GRID_ROTATIONS = (math.pi / 8.0, 3.0 * math.pi / 8.0)  # rad, against walls along x and y
MAX_MIRROR_INCIDENCE = math.radians(8.0)  # for a return by reflection
DIRECTION_WINDOW = math.radians(3.0)  # on both sides of a beam, for the wall's direction


@degradation("%", (20, 40, 60, 80, 100), 0, 100, needs=("truth",))
def glass(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Share of glass in the walls, in panes of about 1 m.

    A pane is glass from all viewpoints. A beam that meets it has no return (inf: the log does not
    contain what lies behind), unless its incidence is within 8 deg of the perpendicular.
    """
    panes = _Panes(rng)
    ranges = np.array(log.ranges)
    for start in range(0, len(log), SCANS_PER_BLOCK):
        block = slice(start, start + SCANS_PER_BLOCK)
        rays = rays_of(log.laser, true_poses(log, log.t[block]))
        hits = np.where(np.isfinite(log.ranges[block]), log.ranges[block], np.nan)
        ends = ends_of(rays, hits)
        through = panes.chance(ends) < 0.01 * level
        through &= _incidence(log.ranges[block], log.laser.angle_increment) > MAX_MIRROR_INCIDENCE
        ranges[block][through] = np.inf
    return replace(log, ranges=ranges)


class _Panes:
    """A grid of squares, rotated against the walls, with a random draw for each square."""

    def __init__(self, rng: Generator) -> None:
        angle = float(rng.uniform(*GRID_ROTATIONS))
        c, s = math.cos(angle), math.sin(angle)
        self.axes = np.array([[c, -s], [s, c]])
        self.draws = rng.random((DRAW_PERIOD, DRAW_PERIOD))

    def chance(self, points: Floats) -> Floats:
        """The draw (...) in [0, 1) of the pane of each point (..., 2) [m]; 1 where not finite."""
        known = np.isfinite(points).all(axis=-1)
        cells = np.floor(points[known] @ self.axes / PANE_SIZE).astype(np.int64) % DRAW_PERIOD
        chance = np.ones(points.shape[:-1])
        chance[known] = self.draws[cells[:, 0], cells[:, 1]]
        return chance


def _incidence(ranges: Ranges, increment: float) -> Floats:
    """Angle (n, b) [rad] between each beam and the perpendicular of its wall.

    The wall's direction is the chord between beams on both sides; a right angle without returns.
    """
    n_beams = ranges.shape[1]
    here = np.arange(n_beams)
    reach = math.ceil(DIRECTION_WINDOW / abs(increment)) if increment else 0
    before, after = np.maximum(here - reach, 0), np.minimum(here + reach, n_beams - 1)
    a, b = ranges[:, before].astype(np.float64), ranges[:, after].astype(np.float64)
    angle_a, angle_b = (before - here) * increment, (after - here) * increment
    with np.errstate(invalid="ignore"):
        along = b * np.cos(angle_b) - a * np.cos(angle_a)
        across = b * np.sin(angle_b) - a * np.sin(angle_a)
        angle: NDArray[np.float64] = np.arctan2(np.abs(along), np.abs(across))
    return np.where(np.isfinite(angle) & (before < after), angle, 0.5 * math.pi)
