"""Simulated odometry and gyro."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from slams.types import Floats, wrap_angle

if TYPE_CHECKING:
    from numpy.random import Generator

    from bench.sim.drive import Drive


class WheelErrors(NamedTuple):
    """Standard deviations of the odometry errors of a skid-steer robot.

    Constant for a drive: `scale` of distances, `turning` of rotations, `straight` [rad/m] of the
    heading. `floor` adds to `turning`, with the correlation time `floor_memory` [s]. Slip grows
    with the root of the distance [m] or rotation [rad]: `ahead_by_*` [m], `turn_by_*` [rad]. The
    two slips by rotation are fully correlated.
    """

    scale: float
    turning: float
    straight: float
    floor: float
    floor_memory: float
    ahead_by_way: float
    ahead_by_turn: float
    turn_by_turn: float
    turn_by_way: float


class GyroErrors(NamedTuple):
    """Standard deviations of the errors of a gyro.

    White `noise` [rad/s] of a sample (with vibration), residual `bias` [rad/s], its random `walk`
    [rad/s per root second], and `scale` of the rate.
    """

    noise: float
    bias: float
    walk: float
    scale: float


START_POSE: Floats = np.zeros(3)
RESCUE_ROBOT_WHEELS = WheelErrors(0.01, 0.03, 0.01, 0.03, 20.0, 0.003, 0.002, 0.01, 0.004)
MEMS_GYRO = GyroErrors(0.004, 0.002, 1e-4, 0.003)


def odometry(true: Drive, t: Floats, rng: Generator) -> Floats:
    """Odometry poses (m, 3) of a skid-steer robot at stamps t (m,) [s]."""
    return counted(true.poses_at(t), t, rng, RESCUE_ROBOT_WHEELS)


def counted(poses: Floats, t: Floats, rng: Generator, wheels: WheelErrors) -> Floats:
    """Odometry poses (m, 3) at stamps t (m,) [s], from true poses (m, 3).

    Scale, turning and heading drift are constant errors of a drive, turning also varies with the
    floor, and every meter and radian adds slip. `RESCUE_ROBOT_WHEELS` has the errors
    of a tracked rescue robot: about 1 % of distances and 5 % of rotations.
    """
    longitudinal, lateral, rotation = steps(poses)
    distance, angle, n = np.hypot(longitudinal, lateral), np.abs(rotation), len(rotation)
    scale, turning, straight = rng.normal(0.0, (wheels.scale, wheels.turning, wheels.straight))
    floor = wander(np.diff(t), wheels.floor, wheels.floor_memory, rng)
    slip = rng.standard_normal((3, n)) * np.sqrt([distance, angle, distance])
    forward = (1.0 + scale) * longitudinal + wheels.ahead_by_way * slip[0]
    forward = forward + wheels.ahead_by_turn * slip[1]
    turn = (1.0 + turning + floor) * rotation + straight * distance
    turn = turn + wheels.turn_by_turn * slip[1] + wheels.turn_by_way * slip[2]
    return integrate(forward, lateral, turn)


def steps(poses: Floats) -> tuple[Floats, Floats, Floats]:
    """Midpoint increments of poses (n + 1, 3): longitudinal, lateral [m], rotation [rad]."""
    (dx, dy, rotation), theta = np.diff(poses, axis=0).T, poses[:-1, 2]
    rotation = wrap_angle(rotation)
    c, s = np.cos(theta + 0.5 * rotation), np.sin(theta + 0.5 * rotation)
    return c * dx + s * dy, c * dy - s * dx, rotation


def integrate(
    longitudinal: Floats, lateral: Floats, rotation: Floats, start: Floats = START_POSE
) -> Floats:
    """Poses (n + 1, 3) from the pose `start` on; the inverse of `steps`."""
    theta = np.cumsum(np.concatenate([start[2:], rotation]))
    half = theta[:-1] + 0.5 * rotation
    dx = np.cos(half) * longitudinal - np.sin(half) * lateral
    dy = np.sin(half) * longitudinal + np.cos(half) * lateral
    places = np.cumsum(np.vstack([start[:2], np.stack([dx, dy], axis=1)]), axis=0)
    poses: Floats = np.column_stack([places, theta])
    poses[:, 2] = wrap_angle(poses[:, 2])
    return poses


def wander(dt: Floats, deviation: float, memory: float, rng: Generator) -> Floats:
    """A first-order Gauss-Markov process (n,) with deviation and correlation time `memory` [s]."""
    keep = math.exp(-float(dt.mean()) / memory)
    wander = rng.normal(0.0, deviation * math.sqrt(1.0 - keep * keep), len(dt))
    wander[:1] = rng.normal(0.0, deviation)
    for i in range(1, len(wander)):
        wander[i] += keep * wander[i - 1]
    return wander


def gyro(true: Drive, t: Floats, rng: Generator) -> Floats:
    """Yaw rates (m,) [rad/s] of a calibrated MEMS gyro at stamps t (m,)."""
    rate = np.interp(t, true.t, true.rates[:, 1])
    bias, scale = rng.normal(0.0, (MEMS_GYRO.bias, MEMS_GYRO.scale))
    walk = np.cumsum(rng.normal(0.0, MEMS_GYRO.walk, len(t)) * np.sqrt(np.diff(t, prepend=t[0])))
    rates: Floats = (1.0 + scale) * rate + bias + walk + rng.normal(0.0, MEMS_GYRO.noise, len(t))
    return rates
