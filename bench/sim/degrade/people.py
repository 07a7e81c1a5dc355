"""People who walk near the robot and occlude its beams."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.degrade.degradation import degradation
from bench.sim.degrade.spells import Mask, elapsed
from bench.sim.people import FOOT_OFFSET, FOOT_SWING, LEG_RADIUS, WALKING_SPEEDS, gait
from bench.sim.rays import SCANS_PER_BLOCK, rays_of, true_poses
from slams.scanlog import ScanLog
from slams.types import Floats, Pose2, Ranges

if TYPE_CHECKING:
    from numpy.random import Generator

# m, so that no leg is nearer than 0.5 m
MIN_PERSON_DISTANCE = 0.5 + LEG_RADIUS + float(np.hypot(FOOT_SWING, FOOT_OFFSET))


@degradation("1", (3, 5, 8, 12, 20, 30, 50), 0, 50, whole=True, needs=("truth",))
def people(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """People who walk near the robot, 0.8 to 1.2 m/s.

    Their legs shorten the beams that meet them, as in `slams simulate --people`. They walk between
    places within 3 m of the laser that it observes.
    """
    truth = log.truth_at(log.t)
    assert truth is not None, "people need a ground truth"
    known = np.isfinite(truth[:, 0])
    legs = np.full((len(log), 2 * int(level), 2), np.nan)
    legs[known] = legs_near(log.rows(known), truth[known], int(level), rng)
    return replace(log, ranges=_occluded(log, known, legs))


def legs_near(log: ScanLog, truth: Floats, n_people: int, rng: Generator) -> Floats:
    """Positions (n, 2 * n_people, 2) [m] of the legs at each scan.

    Each person has an own generator, so the first three of eight people walk as three alone.
    """
    from bench.sim.degrade.people_kernels import stroll

    sensors = np.array([Pose2(*pose) @ log.laser.mount for pose in truth.tolist()])
    seconds = np.diff(elapsed(log.t), prepend=0.0)
    both = []
    for one in rng.spawn(n_people):
        middle = np.empty((len(log), 2))
        strides = float(one.uniform(*WALKING_SPEEDS)) * seconds
        angles = log.laser.angles
        stroll(sensors, log.ranges, angles, strides, MIN_PERSON_DISTANCE, one, middle)
        dx, dy = np.diff(middle, axis=0, prepend=middle[:1]).T
        both.append(gait(middle, np.arctan2(dy, dx), np.cumsum(np.hypot(dx, dy))))
    return np.concatenate(both, axis=1) if both else np.empty((len(log), 0, 2))


def _occluded(log: ScanLog, known: Mask, legs: Floats) -> Ranges:
    """The ranges (n, b), occluded by legs (n, k, 2) that stand still during a scan."""
    from bench.sim.world_kernels import occlude

    ranges = np.array(log.ranges)
    for start in range(0, len(log), SCANS_PER_BLOCK):
        block = start + np.flatnonzero(known[start : start + SCANS_PER_BLOCK])
        rays = rays_of(log.laser, true_poses(log, log.t[block])).reshape(-1, 3)
        distances = log.ranges[block].astype(np.float64).ravel()
        tick = np.repeat(block.astype(np.int32), log.laser.n_beams)
        occlude(rays, tick, legs, LEG_RADIUS, distances)
        ranges[block] = distances.reshape(len(block), log.laser.n_beams)
    return ranges
