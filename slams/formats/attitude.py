"""Attitude from an IMU: by its orientation, else by gyro and accelerometer."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from slams.scanlog import Track
from slams.types import Floats

SETTLING = 2.0  # s over which the accelerometer corrects the gyro: longer than a robot speeds up
GRAVITY, DISTURBED = 9.81, 1.0  # m/s^2; by how much a measured one is off while a robot is shaken

OVERHEAD = 1.0  # rad: by more no robot tilts, its IMU is not mounted as the transforms say


class Inertial(NamedTuple):
    """One message in the IMU's own axes: orientation x, y, z, w (nan: none), rates, acceleration.

    `received` [s] stands in where no header has a stamp.
    """

    sent: float
    received: float
    orientation: tuple[float, float, float, float]
    rates: tuple[float, float, float]
    acceleration: tuple[float, float, float]


def inertial(message: Any, received: float, sent: float) -> Inertial:
    """Of a sensor_msgs/Imu; a covariance of -1 or a zero quaternion says that there is none."""
    q, w, a = message.orientation, message.angular_velocity, message.linear_acceleration
    given = message.orientation_covariance[0] != -1.0 and (q.x or q.y or q.z or q.w)
    orientation = (q.x, q.y, q.z, q.w) if given else (math.nan,) * 4
    return Inertial(sent, received, orientation, (w.x, w.y, w.z), (a.x, a.y, a.z))


def attitude_of(rows: list[Inertial], turned: Floats) -> Track | None:
    """Roll and pitch of the base; `turned` (3, 3) from the IMU's axes to the base's.

    An orientation that never changes is a placeholder. None where nothing is measured.
    """
    if not rows:
        return None
    sent = np.array([row.sent for row in rows])
    t = sent if sent.any() else np.array([row.received for row in rows])
    orientation = np.array([row.orientation for row in rows])
    measured = np.isfinite(orientation).any() and (orientation != orientation[0]).any()
    up = _up(orientation) if measured else _filtered(t, rows)
    x, y, z = (up @ turned.T).T
    with np.errstate(invalid="ignore"):
        attitudes = np.column_stack([np.arctan2(y, z), -np.arcsin(np.clip(x, -1.0, 1.0))])
    known = np.isfinite(attitudes).all(axis=1)
    return Track(t[known], attitudes[known]) if attitudes[known].any() else None


def about_vertical(rate: Track, attitude: Track) -> Track:
    """Turn rate about the vertical (k,) of rates (k, 3) about the axes of a tilted base."""
    attitudes = np.nan_to_num(attitude.attitudes_at(rate.t))
    attitudes[np.abs(attitudes).max(axis=1) > OVERHEAD] = 0.0
    roll, pitch = attitudes.T
    _, y, z = rate.values.T
    return Track(rate.t, (np.sin(roll) * y + np.cos(roll) * z) / np.cos(pitch))


def _up(orientation: Floats) -> Floats:
    """The vertical (n, 3) seen from bodies of these orientations (n, 4) in a level frame."""
    with np.errstate(invalid="ignore"):
        x, y, z, w = (orientation / np.linalg.norm(orientation, axis=1, keepdims=True)).T
    return np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])


def _filtered(t: Floats, rows: list[Inertial]) -> Floats:
    """The vertical (n, 3) by a complementary filter [Mahony08]: gyro, held by the accelerometer."""
    found, up, last = np.full((len(rows), 3), np.nan), np.zeros(3), t[0]
    for i, row in enumerate(rows):
        force, rates = np.array(row.acceleration), np.array(row.rates)
        size = math.sqrt(float(force @ force))
        rests = abs(size - GRAVITY) < DISTURBED
        dt, last = min(max(t[i] - last, 0.0), SETTLING), t[i]
        if up.any() and np.isfinite(rates).all():
            up = up - np.cross(rates, up) * dt
        if rests:
            up = up + (force / size - up) * (dt / SETTLING if up.any() else 1.0)
        if up.any():
            up = up / math.sqrt(float(up @ up))
            found[i] = up
    return found
