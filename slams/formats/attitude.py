"""Attitude from an IMU: by its orientation, else by gyro and accelerometer."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from slams.ros.stamps import seconds
from slams.scanlog import Track
from slams.types import Floats

SETTLING = 2.0  # s over which the accelerometer corrects the gyro: longer than a robot speeds up
GRAVITY, DISTURBED = 9.81, 1.0  # m/s^2; by how much a measured one is off while a robot is shaken

OVERHEAD = 1.0  # rad: by more no robot tilts, its IMU is not mounted as the transforms say


class Inertial(NamedTuple):
    """One message in the IMU's own axes: orientation x, y, z, w, rates, acceleration; nan: none."""

    sent: float
    orientation: tuple[float, float, float, float]
    rates: tuple[float, float, float]
    acceleration: tuple[float, float, float]


def inertial(message: Any) -> Inertial:
    """Of a sensor_msgs/Imu; a covariance of -1 or a zero quaternion says that there is none."""
    q, w, a = message.orientation, message.angular_velocity, message.linear_acceleration
    oriented = message.orientation_covariance[0] != -1.0 and (q.x or q.y or q.z or q.w)
    turning = message.angular_velocity_covariance[0] != -1.0
    return Inertial(
        seconds(message.header.stamp),
        (q.x, q.y, q.z, q.w) if oriented else (math.nan,) * 4,
        (w.x, w.y, w.z) if turning else (math.nan,) * 3,
        (a.x, a.y, a.z),
    )


def attitude_of(t: Floats, rows: list[Inertial], turned: Floats) -> Track | None:
    """Roll and pitch of the base; `turned` (3, 3) from the IMU's axes to the base's.

    An orientation that never changes is a placeholder. None where nothing is measured.
    """
    if not rows:
        return None
    orientation = np.array([row.orientation for row in rows])
    measured = np.isfinite(orientation).any() and (orientation != orientation[0]).any()
    up = up_of(orientation) if measured else _filtered(t, rows)
    attitudes = roll_and_pitch(rotated(up, turned))
    known = np.isfinite(attitudes).all(axis=1)
    return Track(t[known], attitudes[known]) if attitudes[known].any() else None


def rotated(vectors: Floats, matrix: Floats) -> Floats:
    """Vectors (n, 3) turned by a matrix (3, 3); each row has the same bits on its own."""
    x, y, z = vectors.T
    return np.column_stack([row[0] * x + row[1] * y + row[2] * z for row in matrix])


def roll_and_pitch(up: Floats) -> Floats:
    """Attitudes (n, 2) [rad] of bases that have the vertical (n, 3) in their axes."""
    x, y, z = up.T
    with np.errstate(invalid="ignore"):
        return np.column_stack([np.arctan2(y, z), -np.arcsin(np.clip(x, -1.0, 1.0))])


def about_vertical(rate: Track, attitude: Track) -> Track:
    """Turn rate about the vertical (k,) of rates (k, 3) about the axes of a tilted base."""
    return Track(rate.t, vertical_rates(rate.values, attitude.attitudes_at(rate.t)))


def vertical_rates(rates: Floats, attitudes: Floats) -> Floats:
    """Turn rates about the vertical (n,) of rates (n, 3) about a base's axes, by attitudes (n, 2).

    Without an attitude, nan, or with an impossible one, that about the upright axis.
    """
    attitudes = np.nan_to_num(attitudes)
    attitudes[np.abs(attitudes).max(axis=1) > OVERHEAD] = 0.0
    roll, pitch = attitudes.T
    _, y, z = rates.T
    about: Floats = (np.sin(roll) * y + np.cos(roll) * z) / np.cos(pitch)
    return about


def up_of(orientation: Floats) -> Floats:
    """The vertical (n, 3) seen from bodies of these orientations (n, 4) in a level frame."""
    with np.errstate(invalid="ignore"):
        x, y, z, w = (orientation / np.linalg.norm(orientation, axis=1, keepdims=True)).T
    return np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])


def headings(orientation: Floats) -> Floats:
    """Headings (n,) [rad] of orientations (n, 4) of any length."""
    x, y, z, w = orientation.T
    found: Floats = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return found


def _filtered(t: Floats, rows: list[Inertial]) -> Floats:
    """The vertical (n, 3) by `GravityFilter`."""
    gravity = GravityFilter()
    return np.array([gravity.push(stamp, row) for stamp, row in zip(t.tolist(), rows, strict=True)])


class GravityFilter:
    """The vertical by a complementary filter [Mahony08]: gyro, held by the accelerometer."""

    def __init__(self) -> None:
        self._up, self._last = np.zeros(3), math.nan

    def push(self, t: float, row: Inertial) -> Floats:
        """The vertical (3,) in the IMU's axes after a message of time t [s]; nan where unknown."""
        up, force, rates = self._up, np.array(row.acceleration), np.array(row.rates)
        size = math.sqrt(float(force @ force))
        rests = abs(size - GRAVITY) < DISTURBED
        dt = 0.0 if math.isnan(self._last) else min(max(t - self._last, 0.0), SETTLING)
        self._last = t
        if up.any() and np.isfinite(rates).all():
            up = up - np.cross(rates, up) * dt
        if rests:
            up = up + (force / size - up) * (dt / SETTLING if up.any() else 1.0)
        if not up.any():
            return np.full(3, np.nan)
        self._up = up / math.sqrt(float(up @ up))
        return self._up
