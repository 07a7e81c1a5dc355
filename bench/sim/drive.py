"""Smooth drives through a world that touch nothing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.routes import SPACING, Routes
from bench.sim.world import World
from slams.metrics import driven
from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator

MARGIN = 0.1  # m, by which the planned way keeps off more than the drive must
AT_ONCE = 500_000  # points looked up at a time
BRAKE = 0.8  # share of the deceleration counted on ahead of bends
# look-ahead [m] and share of the speed, from brisk to careful, until the drive touches nothing
CARE = ((0.4, 1.0), (0.3, 1.0), (0.2, 1.0), (0.1, 1.0), (0.2, 0.5), (0.1, 0.3))


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
    """How something moves.

    At most `v` [m/s], `w` [rad/s], `dv` [m/s^2] and `dw` [rad/s^2], `clearance` [m] from all walls;
    for `laps` it would rather go on than turn back.
    """

    v: float = 0.5
    w: float = 0.8
    clearance: float = 0.3
    dv: float = 0.5
    dw: float = 1.5
    laps: bool = False


def drive(world: World, robot: Robot, rng: Generator, seconds: float, rate: float) -> Drive:
    """A drive from rest of `seconds` [s], with `rate` samples a second.

    Raises:
        ValueError: the world has no room for it.
    """
    from bench.sim.drive_kernels import Limits, follow

    routes = Routes(world, robot.clearance + MARGIN, robot.laps)
    way = routes.way(1.2 * robot.v * seconds + 2.0, rng)
    pace = _pace(way, _room(world, way), robot)
    states = np.empty((math.ceil(seconds * rate - 1e-6) + 1, 5))
    for look_ahead, share in CARE:
        limits = Limits(robot.w, robot.dv, robot.dw, look_ahead)
        follow(way, share * pace, limits, 1.0 / rate, states)
        if _least_room(world, states[:, :2]) >= robot.clearance:
            return Drive(np.arange(len(states)) / rate, states[:, :3], states[:, 3:])
    raise ValueError(
        f"no drive keeps {robot.clearance:.2f} m to every wall; give a smaller clearance"
    )


def drive_far(world: World, robot: Robot, rng: Generator, metres: float, rate: float) -> Drive:
    """A drive from rest that ends after `metres` [m] of way."""
    seconds, state = 2.0 * metres / robot.v + 60.0, rng.bit_generator.state
    while True:
        rng.bit_generator.state = state
        far = drive(world, robot, rng, seconds, rate)
        way = driven(far.poses)
        if way[-1] >= metres:
            n = int(np.searchsorted(way, metres)) + 1
            return Drive(far.t[:n], far.poses[:n], far.rates[:n])
        seconds *= 2.0


def _pace(way: Floats, room: Floats, robot: Robot) -> Floats:
    """Speed (m,) [m/s] at each point of a way (m, 2): less where it is narrow or bends."""
    n, here = round(0.15 / SPACING), np.arange(len(way))
    before = way - way[np.maximum(here - n, 0)]
    after = way[np.minimum(here + n, len(way) - 1)] - way
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    bend = np.abs(np.arctan2(cross, (before * after).sum(axis=1)))
    narrow = robot.v * np.clip(room / 0.6, 0.5, 1.0)
    speed: Floats = np.minimum(narrow, 0.3 * robot.w / np.maximum(bend, 1e-3))
    for i in range(len(speed) - 2, -1, -1):  # brake in time
        speed[i] = min(speed[i], math.sqrt(speed[i + 1] ** 2 + 2.0 * SPACING * BRAKE * robot.dv))
    return speed


def _least_room(world: World, points: Floats) -> float:
    """The least room of points (n, 2) [m], of many in several goes."""
    parts = np.array_split(points, math.ceil(len(points) / AT_ONCE))
    return min(float(_room(world, part).min()) for part in parts)


def _room(world: World, points: Floats) -> Floats:
    """At least this far [m] are points (n, 2) from the nearest wall's square."""
    half_diagonals = math.sqrt(2.0) * world.resolution  # of the point's own cell and of the wall's
    room = world.clearance[world.cells_of(points)].astype(np.float64)
    return np.asarray(room - half_diagonals)
