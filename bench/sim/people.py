"""Positions of the legs of walking people."""

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

LEG_RADIUS = 0.06  # m, with trousers
WALKING_SPEEDS = (0.8, 1.2)  # m/s
STEP_LENGTH = 0.7  # m
FOOT_SWING = 0.25  # m, longitudinal, from the middle of the body
FOOT_OFFSET = 0.1  # m, lateral, from the middle of the body


def legs(world: World, robot: Drive, people: int, rng: Generator) -> Floats:
    """Positions (n, 2 * people, 2) [m] of the legs of people at each sample of the drive.

    People walk at 0.8 to 1.2 m/s on their own paths and avoid the robot.
    """
    rate, seconds = 1.0 / (robot.t[1] - robot.t[0]), float(robot.t[-1])
    both = []
    for one in rng.spawn(people):
        v = float(one.uniform(*WALKING_SPEEDS))
        walk = drive(world, Robot(v, 2.0, 0.25, 2.0, 6.0), one, seconds, rate)
        middle = _kept_away(walk.poses[:, :2], robot.poses[:, :2], 0.6)
        both.append(gait(middle, walk.poses[:, 2], driven(walk.poses)))
    return np.concatenate(both, axis=1)


def gait(middle: Floats, heading: Floats, travelled: Floats) -> Floats:
    """Both legs (n, 2, 2) [m] of a person at `middle` (n, 2) after `travelled` (n,) [m]."""
    swing = FOOT_SWING * np.sin(math.pi / STEP_LENGTH * travelled)[:, None]
    c, s = np.cos(heading), np.sin(heading)
    front, left = np.stack([c, s], axis=1), np.stack([-s, c], axis=1)
    stride = swing * front + FOOT_OFFSET * left
    return np.stack([middle + stride, middle - stride], axis=1)


def _kept_away(points: Floats, robot: Floats, min_distance: float) -> Floats:
    """Points (n, 2) moved away from the robot's (n, 2) to at least `min_distance` [m]."""
    offset = points - robot
    distance = np.hypot(*offset.T)[:, None]
    return np.asarray(robot + offset * np.maximum(1.0, min_distance / np.maximum(distance, 1e-6)))
