"""People who walk near the robot, across its view, cast against the true poses."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.degrade.degradation import degradation
from bench.sim.degrade.spells import Mask, elapsed
from bench.sim.people import APART, LEG, PACE, SWING, gait
from bench.sim.rays import rays_of, true_poses
from slams.scanlog import ScanLog
from slams.types import Floats, Pose2, Ranges

if TYPE_CHECKING:
    from numpy.random import Generator

BLOCK = 200  # scans at once
LEAST = 0.5 + LEG + float(np.hypot(SWING, APART))  # m, so that no leg comes nearer than 0.5 m


@degradation("1", (3, 5, 8, 12, 20, 30, 50), 0, 50, whole=True, needs=("truth",))
def people(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """People who walk near the robot, 0.8 to 1.2 m/s.

    Their legs shorten the beams that meet them. Legs rather than bodies, as in `slams simulate
    --people`: that is what a laser on a robot sees. They walk from place to place that the
    laser sees, within 3 m of it, at 0.8 to 1.2 m/s.
    """
    truth = log.truth_at(log.t)
    assert truth is not None, "the catalog says that people need a truth"
    known = np.isfinite(truth[:, 0])
    legs = np.full((len(log), 2 * int(level), 2), np.nan)
    legs[known] = legs_near(log.rows(known), truth[known], int(level), rng)
    return replace(log, ranges=_occluded(log, known, legs))


def legs_near(log: ScanLog, truth: Floats, n_people: int, rng: Generator) -> Floats:
    """Where the legs (n, 2 * n_people, 2) [m] are at each scan; everybody has chances of their own.

    So the first of eight people walk as they do when there are only three.
    """
    from bench.sim.degrade.people_kernels import stroll

    sensors = np.array([Pose2(*pose) @ log.laser.mount for pose in truth.tolist()])
    seconds = np.diff(elapsed(log.t), prepend=0.0)
    both = []
    for one in rng.spawn(n_people):
        middle = np.empty((len(log), 2))
        pace = float(one.uniform(*PACE))
        stroll(sensors, log.ranges, log.laser.angles, pace * seconds, LEAST, one, middle)
        dx, dy = np.diff(middle, axis=0, prepend=middle[:1]).T
        both.append(gait(middle, np.arctan2(dy, dx), np.cumsum(np.hypot(dx, dy))))
    return np.concatenate(both, axis=1) if both else np.empty((len(log), 0, 2))


def _occluded(log: ScanLog, known: Mask, legs: Floats) -> Ranges:
    """The ranges (n, b) with the legs (n, k, 2) in the way; they stand still for each scan."""
    from bench.sim.world_kernels import occlude

    ranges = np.array(log.ranges)
    for start in range(0, len(log), BLOCK):
        block = start + np.flatnonzero(known[start : start + BLOCK])
        rays = rays_of(log.laser, true_poses(log, log.t[block])).reshape(-1, 3)
        seen = log.ranges[block].astype(np.float64).ravel()
        tick = np.repeat(block.astype(np.int32), log.laser.n_beams)
        occlude(rays, tick, legs, LEG, seen)
        ranges[block] = seen.reshape(len(block), log.laser.n_beams)
    return ranges
