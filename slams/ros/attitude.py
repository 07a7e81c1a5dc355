"""Attitude and turn rate from an IMU, message by message, for logs and on a robot."""

from __future__ import annotations

import math

import numpy as np

from slams.ros.messages import ImuReading
from slams.types import Floats

FILTER_TIME_CONSTANT = (
    2.0  # s over which the accelerometer corrects the gyro: longer than a robot speeds up
)
GRAVITY, MAX_GRAVITY_ERROR = (
    9.81,
    1.0,
)  # m/s^2; by how much a measured one is off while a robot is shaken
MAX_MOUNTED_TILT = 1.0  # rad: by more no robot tilts, its IMU is not mounted as the transforms say


class ImuAttitude:
    """Attitude and turn rate of the base from its IMU: by orientation, else gyro and accelerometer.

    These two by a complementary filter [Mahony08]: the gyro, held by the accelerometer.

    Args:
        turned: (3, 3), from the IMU's axes to the base's; None: not known, the IMU is upright.
    """

    def __init__(self, rotation: Floats | None) -> None:
        self._rotation = rotation
        self._vertical, self._last_stamp = (
            np.zeros(3),
            math.nan,
        )  # the vertical in the IMU's axes; its stamp

    def push(self, measured: ImuReading) -> tuple[float, float, float, float]:
        """Take a message.

        Gives its stamp [s], turn rate about the vertical [rad/s], roll and pitch [rad], nan where
        unknown.
        """
        if self._rotation is None:
            return measured.stamp, measured.rates[2], math.nan, math.nan
        if math.isfinite(measured.orientation[0]):
            up = vertical_of(np.array([measured.orientation]))[0]
        else:
            up = self._filtered(measured)
        # plain sums: those of @ are not the same, bit for bit, on every machine
        of_base, rates = ((self._rotation * one).sum(axis=1) for one in (up, measured.rates))
        roll, pitch = roll_and_pitch(of_base[None])[0].tolist()
        return measured.stamp, vertical_rate(rates, roll, pitch), roll, pitch

    def _filtered(self, row: ImuReading) -> Floats:
        """The vertical (3,) in the IMU's axes after a message; nan where unknown."""
        up, force, rates = self._vertical, np.array(row.acceleration), np.array(row.rates)
        size = math.sqrt(float(force @ force))
        rests = abs(size - GRAVITY) < MAX_GRAVITY_ERROR
        dt = (
            0.0
            if math.isnan(self._last_stamp)
            else min(max(row.stamp - self._last_stamp, 0.0), FILTER_TIME_CONSTANT)
        )
        self._last_stamp = row.stamp
        if up.any() and np.isfinite(rates).all():
            up = up - np.cross(rates, up) * dt
        if rests:
            up = up + (force / size - up) * (dt / FILTER_TIME_CONSTANT if up.any() else 1.0)
        if not up.any():
            return np.full(3, np.nan)
        self._vertical = up / math.sqrt(float(up @ up))
        return self._vertical


def roll_and_pitch(up: Floats) -> Floats:
    """Attitudes (n, 2) [rad] of bases that have the vertical (n, 3) in their axes."""
    x, y, z = up.T
    with np.errstate(invalid="ignore"):
        return np.column_stack([np.arctan2(y, z), -np.arcsin(np.clip(x, -1.0, 1.0))])


def vertical_rate(rates: Floats, roll: float, pitch: float) -> float:
    """Turn rate about the vertical of rates (3,) about a base's axes.

    Without an attitude, nan, or with an impossible one, that about the upright axis.
    """
    if not max(abs(roll), abs(pitch)) <= MAX_MOUNTED_TILT:
        roll = pitch = 0.0
    return float((math.sin(roll) * rates[1] + math.cos(roll) * rates[2]) / math.cos(pitch))


def vertical_of(orientation: Floats) -> Floats:
    """The vertical (n, 3) seen from bodies of these orientations (n, 4) in a level frame."""
    with np.errstate(invalid="ignore"):
        x, y, z, w = (orientation / np.linalg.norm(orientation, axis=1, keepdims=True)).T
    return np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])


def headings(orientation: Floats) -> Floats:
    """Headings (n,) [rad] of orientations (n, 4) of any length."""
    x, y, z, w = orientation.T
    found: Floats = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return found
