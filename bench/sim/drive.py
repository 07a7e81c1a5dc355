"""Smooth, collision-free drives through a world."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.routes import PATH_SPACING, Routes
from bench.sim.world import World
from slams.metrics import driven
from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator

PLANNING_MARGIN = 0.1  # m, clearance of the planned path beyond that of the drive
POINTS_PER_BLOCK = 500_000  # for map lookups
BRAKING_SHARE = 0.8  # of the deceleration, used before bends
# look-ahead [m] and share of the speed, from fast to careful, until the drive has no collision
FOLLOWING_ATTEMPTS = ((0.4, 1.0), (0.3, 1.0), (0.2, 1.0), (0.1, 1.0), (0.2, 0.5), (0.1, 0.3))


@dataclass(frozen=True)
class Drive:
    """True motion at a fine, even rate: t (n,) [s], poses (n, 3), rates (n, 2) v, w."""

    t: Floats
    poses: Floats
    rates: Floats

    def poses_at(self, t: Floats) -> Floats:
        """Poses (m, 3) at stamps t (m,), heading not wrapped."""
        poses: Floats = np.stack([np.interp(t, self.t, c) for c in self.poses.T], axis=1)
        return poses


@dataclass(frozen=True)
class Robot:
    """Limits of a robot or person.

    At most `v` [m/s], `w` [rad/s], `dv` [m/s^2] and `dw` [rad/s^2], `clearance` [m] from all walls;
    with `laps` it prefers driving on to turning back.
    """

    v: float = 0.5
    w: float = 0.8
    clearance: float = 0.3
    dv: float = 0.5
    dw: float = 1.5
    laps: bool = False


def drive(world: World, robot: Robot, rng: Generator, seconds: float, rate: float) -> Drive:
    """A drive from rest of `seconds` [s], with `rate` samples per second.

    Raises:
        ValueError: the world has no room for the drive.
    """
    from bench.sim.drive_kernels import Limits, follow

    routes = Routes(world, robot.clearance + PLANNING_MARGIN, robot.laps)
    path = routes.path(1.2 * robot.v * seconds + 2.0, rng)
    speed = _speed(path, _clearance(world, path), robot)
    states = np.empty((math.ceil(seconds * rate - 1e-6) + 1, 5))
    for look_ahead, share in FOLLOWING_ATTEMPTS:
        limits = Limits(robot.w, robot.dv, robot.dw, look_ahead)
        follow(path, share * speed, limits, 1.0 / rate, states)
        if _min_clearance(world, states[:, :2]) >= robot.clearance:
            return Drive(np.arange(len(states)) / rate, states[:, :3], states[:, 3:])
    raise ValueError(
        f"no drive keeps {robot.clearance:.2f} m to every wall; give a smaller clearance"
    )


def drive_far(world: World, robot: Robot, rng: Generator, metres: float, rate: float) -> Drive:
    """A drive from rest that ends after a path of `metres` [m]."""
    seconds, state = 2.0 * metres / robot.v + 60.0, rng.bit_generator.state
    while True:
        rng.bit_generator.state = state
        far = drive(world, robot, rng, seconds, rate)
        length = driven(far.poses)
        if length[-1] >= metres:
            n = int(np.searchsorted(length, metres)) + 1
            return Drive(far.t[:n], far.poses[:n], far.rates[:n])
        seconds *= 2.0


def _speed(path: Floats, clearance: Floats, robot: Robot) -> Floats:
    """Speed (m,) [m/s] at each point of a path (m, 2), reduced at narrow places and bends."""
    n, here = round(0.15 / PATH_SPACING), np.arange(len(path))
    before = path - path[np.maximum(here - n, 0)]
    after = path[np.minimum(here + n, len(path) - 1)] - path
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    bend = np.abs(np.arctan2(cross, (before * after).sum(axis=1)))
    narrow = robot.v * np.clip(clearance / 0.6, 0.5, 1.0)
    speed: Floats = np.minimum(narrow, 0.3 * robot.w / np.maximum(bend, 1e-3))
    for i in range(len(speed) - 2, -1, -1):  # brake in time
        v2 = speed[i + 1] ** 2 + 2.0 * PATH_SPACING * BRAKING_SHARE * robot.dv
        speed[i] = min(speed[i], math.sqrt(v2))
    return speed


def _min_clearance(world: World, points: Floats) -> float:
    """The smallest clearance [m] of points (n, 2) [m], in blocks."""
    parts = np.array_split(points, math.ceil(len(points) / POINTS_PER_BLOCK))
    return min(float(_clearance(world, part).min()) for part in parts)


def _clearance(world: World, points: Floats) -> Floats:
    """Lower bound (n,) [m] of the distance from points (n, 2) to the nearest wall's square."""
    half_diagonals = math.sqrt(2.0) * world.resolution  # of the cells of point and wall
    clearance = world.clearance[world.cells_of(points)].astype(np.float64)
    return np.asarray(clearance - half_diagonals)
