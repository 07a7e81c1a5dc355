"""What wheels and gyro make of a true motion; a filter's bound knows the same figures."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from slams.types import Floats, wrap_angle

if TYPE_CHECKING:
    from numpy.random import Generator

    from bench.sim.drive import Drive


class WheelErrors(NamedTuple):
    """Standard deviations of what a skid-steer robot's wheels get wrong.

    For the whole drive: `scale` of the way, `turning` of the turn, `straight` [rad/m]; `floor`
    adds to `turning` and changes with a memory of `floor_memory` [s]. Slip grows with the root of
    the way [m] or turn [rad]: of the way ahead [m], of the turn [rad]. The two slips by turn are
    one and the same, so many parts of each.
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
    """Standard deviations of what a gyro gets wrong.

    White `noise` [rad/s] of a sample (vibration included), a rest of `bias` [rad/s] that does a
    `walk` [rad/s per root second], and `scale` of the rate.
    """

    noise: float
    bias: float
    walk: float
    scale: float


ORIGIN: Floats = np.zeros(3)
WHEELS = WheelErrors(0.01, 0.03, 0.01, 0.03, 20.0, 0.003, 0.002, 0.01, 0.004)
GYRO = GyroErrors(0.004, 0.002, 1e-4, 0.003)


def odometry(true: Drive, t: Floats, rng: Generator) -> Floats:
    """Poses (m, 3) at stamps t (m,) [s] as the wheels of a skid-steer robot count them."""
    return counted(true.poses_at(t), t, rng, WHEELS)


def counted(poses: Floats, t: Floats, rng: Generator, wheels: WheelErrors) -> Floats:
    """Poses (m, 3) at stamps t (m,) [s] as wheels count them.

    Scale, turning and straightness are a little wrong for the whole drive, turning changes with
    the floor besides, and every metre and radian adds slip. `WHEELS` are as wrong as a tracked
    rescue robot's: about 1 % of the way and 5 % of the turns.
    """
    ahead, aside, turn = steps(poses)
    way, turned, n = np.hypot(ahead, aside), np.abs(turn), len(turn)
    scale, turning, straight = rng.normal(0.0, (wheels.scale, wheels.turning, wheels.straight))
    floor = wander(np.diff(t), wheels.floor, wheels.floor_memory, rng)
    slip = rng.standard_normal((3, n)) * np.sqrt([way, turned, way])
    d_ahead = (1.0 + scale) * ahead + wheels.ahead_by_way * slip[0] + wheels.ahead_by_turn * slip[1]
    d_turn = (1.0 + turning + floor) * turn + straight * way
    d_turn = d_turn + wheels.turn_by_turn * slip[1] + wheels.turn_by_way * slip[2]
    return integrate(d_ahead, aside, d_turn)


def steps(poses: Floats) -> tuple[Floats, Floats, Floats]:
    """Motion from pose to pose (n + 1, 3), seen from the heading half way: ahead, aside, turn."""
    (dx, dy, turn), theta = np.diff(poses, axis=0).T, poses[:-1, 2]
    turn = wrap_angle(turn)
    c, s = np.cos(theta + 0.5 * turn), np.sin(theta + 0.5 * turn)
    return c * dx + s * dy, c * dy - s * dx, turn


def integrate(ahead: Floats, aside: Floats, turn: Floats, start: Floats = ORIGIN) -> Floats:
    """Poses (n + 1, 3) from the pose `start` on; the inverse of `steps`."""
    theta = np.cumsum(np.concatenate([start[2:], turn]))
    half = theta[:-1] + 0.5 * turn
    dx, dy = (
        np.cos(half) * ahead - np.sin(half) * aside,
        np.sin(half) * ahead + np.cos(half) * aside,
    )
    places = np.cumsum(np.vstack([start[:2], np.stack([dx, dy], axis=1)]), axis=0)
    poses: Floats = np.column_stack([places, theta])
    poses[:, 2] = wrap_angle(poses[:, 2])
    return poses


def wander(dt: Floats, deviation: float, memory: float, rng: Generator) -> Floats:
    """A value (n,) that drifts around 0 with a standard deviation and a memory [s]."""
    keep = math.exp(-float(dt.mean()) / memory)
    wander = rng.normal(0.0, deviation * math.sqrt(1.0 - keep * keep), len(dt))
    wander[:1] = rng.normal(0.0, deviation)
    for i in range(1, len(wander)):
        wander[i] += keep * wander[i - 1]
    return wander


def gyro(true: Drive, t: Floats, rng: Generator) -> Floats:
    """Yaw rates (m,) [rad/s] at stamps t (m,) as a calibrated MEMS gyro gives them."""
    rate = np.interp(t, true.t, true.rates[:, 1])
    bias, scale = rng.normal(0.0, (GYRO.bias, GYRO.scale))
    walk = np.cumsum(rng.normal(0.0, GYRO.walk, len(t)) * np.sqrt(np.diff(t, prepend=t[0])))
    rates: Floats = (1.0 + scale) * rate + bias + walk + rng.normal(0.0, GYRO.noise, len(t))
    return rates
