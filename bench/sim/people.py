"""People on foot: where their legs are."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.drive import Drive, Robot, drive
from slams.metrics import driven
from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator

    from bench.sim.world import World

LEG = 0.06  # m, radius of a leg with trousers
PACE = (0.8, 1.2)  # m/s, the slowest and the fastest
STEP = 0.7  # m, from footfall to footfall
SWING = 0.25  # m, from the middle to a foot put forward
APART = 0.1  # m, from the middle to either side


def legs(world: World, robot: Drive, people: int, rng: Generator) -> Floats:
    """Where the legs (n, 2 * people, 2) [m] of walking people are at each sample of the drive.

    People walk 0.8 to 1.2 m/s on ways of their own and step aside when the robot comes near.
    """
    rate, seconds = 1.0 / (robot.t[1] - robot.t[0]), float(robot.t[-1])
    both = []
    for one in rng.spawn(people):
        v = float(one.uniform(*PACE))
        walk = drive(world, Robot(v, 2.0, 0.25, 2.0, 6.0), one, seconds, rate)
        middle = _aside(walk.poses[:, :2], robot.poses[:, :2], 0.6)
        both.append(gait(middle, walk.poses[:, 2], driven(walk.poses)))
    return np.concatenate(both, axis=1)


def gait(middle: Floats, heading: Floats, travelled: Floats) -> Floats:
    """Both legs (n, 2, 2) [m] of somebody at `middle` (n, 2) who has `travelled` (n,) [m]."""
    swing = SWING * np.sin(math.pi / STEP * travelled)[:, None]
    c, s = np.cos(heading), np.sin(heading)
    ahead, left = np.stack([c, s], axis=1), np.stack([-s, c], axis=1)
    stride = swing * ahead + APART * left
    return np.stack([middle + stride, middle - stride], axis=1)


def _aside(points: Floats, robot: Floats, least: float) -> Floats:
    """Points (n, 2) moved straight away from the robot's (n, 2) to at least `least` [m]."""
    away = points - robot
    distance = np.hypot(*away.T)[:, None]
    return np.asarray(robot + away * np.maximum(1.0, least / np.maximum(distance, 1e-6)))
