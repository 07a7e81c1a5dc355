"""People who walk about, as a laser at the height of a robot sees them: two legs each."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.drive import Drive, Robot, drive
from bench.sim.world import World
from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator

LEG = 0.06  # m, radius of a leg with trousers


def legs(world: World, robot: Drive, people: int, rng: Generator) -> Floats:
    """Where the legs (n, 2 * people, 2) [m] of walking people are at each sample of the drive.

    People walk 0.8 to 1.2 m/s on ways of their own and step aside when the robot comes near.
    """
    rate, seconds = 1.0 / (robot.t[1] - robot.t[0]), float(robot.t[-1])
    both = []
    for one in rng.spawn(people):
        v = float(one.uniform(0.8, 1.2))
        walk = drive(world, Robot(v, 2.0, 0.25, 2.0, 6.0), one, seconds, rate)
        middle = _aside(walk.poses[:, :2], robot.poses[:, :2], 0.6)
        swing = 0.25 * np.sin(math.pi / 0.7 * walk.travelled)[:, None]
        c, s = np.cos(walk.poses[:, 2]), np.sin(walk.poses[:, 2])
        ahead, left = np.stack([c, s], axis=1), np.stack([-s, c], axis=1)
        both += [middle + swing * ahead + 0.1 * left, middle - swing * ahead - 0.1 * left]
    return np.stack(both, axis=1)


def _aside(points: Floats, robot: Floats, least: float) -> Floats:
    """Points (n, 2) moved straight away from the robot's (n, 2) to at least `least` [m]."""
    away = points - robot
    distance = np.hypot(*away.T)[:, None]
    return np.asarray(robot + away * np.maximum(1.0, least / np.maximum(distance, 1e-6)))
