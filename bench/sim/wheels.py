"""What wheels and gyro make of a true drive."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from slams.types import Floats, wrap_angle

if TYPE_CHECKING:
    from numpy.random import Generator

    from bench.sim.drive import Drive

ORIGIN: Floats = np.zeros(3)


def odometry(true: Drive, t: Floats, rng: Generator) -> Floats:
    """Poses (m, 3) at stamps t (m,) [s] as the wheels of a skid-steer robot count them.

    Scale, turning and straightness are a little wrong for the whole drive, turning changes with
    the floor besides, and every metre and radian adds slip. As large as on a tracked rescue robot:
    about 1 % of the way and 5 % of the turns.
    """
    ahead, aside, turn = steps(true.poses_at(t))
    way, turned, n = np.hypot(ahead, aside), np.abs(turn), len(turn)
    scale, turning, straight = rng.normal(0.0, (0.01, 0.03, 0.01))
    floor = _wander(np.diff(t), 0.03, 20.0, rng)
    slip = rng.standard_normal((3, n)) * np.sqrt([way, turned, way])
    d_ahead = (1.0 + scale) * ahead + 0.003 * slip[0] + 0.002 * slip[1]
    d_turn = (1.0 + turning + floor) * turn + straight * way + 0.01 * slip[1] + 0.004 * slip[2]
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


def _wander(dt: Floats, deviation: float, memory: float, rng: Generator) -> Floats:
    """A value (n,) that drifts around 0 with a standard deviation and a memory [s]."""
    keep = math.exp(-float(dt.mean()) / memory)
    wander = rng.normal(0.0, deviation * math.sqrt(1.0 - keep * keep), len(dt))
    wander[:1] = rng.normal(0.0, deviation)
    for i in range(1, len(wander)):
        wander[i] += keep * wander[i - 1]
    return wander


def gyro(true: Drive, t: Floats, rng: Generator) -> Floats:
    """Yaw rates (m,) [rad/s] at stamps t (m,) as a calibrated MEMS gyro gives them.

    White noise 0.004 rad/s (vibration included), a rest of bias 0.002 rad/s that walks
    1e-4 rad/s per root second, scale right within 0.3 %.
    """
    rate = np.interp(t, true.t, true.rates[:, 1])
    bias, scale = rng.normal(0.0, (0.002, 0.003))
    walk = np.cumsum(rng.normal(0.0, 1e-4, len(t)) * np.sqrt(np.diff(t, prepend=t[0])))
    rates: Floats = (1.0 + scale) * rate + bias + walk + rng.normal(0.0, 0.004, len(t))
    return rates
