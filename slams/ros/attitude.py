"""Attitude and yaw rate of the base from IMU readings, one by one, for logs and on a robot."""

from __future__ import annotations

import math

import numpy as np

from slams.ros.messages import ImuReading
from slams.types import Floats

FILTER_TIME_CONSTANT = 2.0  # s of the accelerometer's correction: longer than a robot accelerates
GRAVITY = 9.81  # m/s^2
MAX_GRAVITY_ERROR = 1.0  # m/s^2 of a measured acceleration; with more the robot is shaken
MAX_PLAUSIBLE_TILT = 1.0  # rad of a robot; with more, tf has the IMU's mount wrong


class ImuAttitude:
    """Attitude and yaw rate of the base from its IMU: by orientation, or gyro and accelerometer.

    The complementary filter [Mahony08] integrates the gyro; the accelerometer corrects its drift.

    Args:
        rotation: (3, 3), from the IMU's axes to the base's; None: unknown, the IMU is upright.
    """

    def __init__(self, rotation: Floats | None) -> None:
        self._rotation = rotation
        self._vertical, self._last_stamp = np.zeros(3), math.nan  # vertical in the IMU's axes

    def push(self, measured: ImuReading) -> tuple[float, float, float, float]:
        """Stamp [s], rate about the vertical [rad/s], roll, pitch [rad]; unknown values are nan."""
        if self._rotation is None:
            return measured.stamp, measured.rates[2], math.nan, math.nan
        if math.isfinite(measured.orientation[0]):
            up = vertical_of(np.array([measured.orientation]))[0]
        else:
            up = self._filtered(measured)
        # sum() gives the same bits on every machine, @ does not
        of_base, rates = ((self._rotation * one).sum(axis=1) for one in (up, measured.rates))
        roll, pitch = roll_and_pitch(of_base[None])[0].tolist()
        return measured.stamp, vertical_rate(rates, roll, pitch), roll, pitch

    def _filtered(self, row: ImuReading) -> Floats:
        """The vertical (3,) in the IMU's axes by the complementary filter; nan while unknown."""
        up, force, rates = self._vertical, np.array(row.acceleration), np.array(row.rates)
        norm = math.sqrt(float(force @ force))
        is_gravity = abs(norm - GRAVITY) < MAX_GRAVITY_ERROR
        before, self._last_stamp = self._last_stamp, row.stamp
        dt = 0.0 if math.isnan(before) else min(max(row.stamp - before, 0.0), FILTER_TIME_CONSTANT)
        if up.any() and np.isfinite(rates).all():
            up = up - np.cross(rates, up) * dt
        if is_gravity:
            up = up + (force / norm - up) * (dt / FILTER_TIME_CONSTANT if up.any() else 1.0)
        if not up.any():
            return np.full(3, np.nan)
        self._vertical = up / math.sqrt(float(up @ up))
        return self._vertical


def roll_and_pitch(up: Floats) -> Floats:
    """Roll and pitch (n, 2) [rad] from the vertical (n, 3) in a base's axes."""
    x, y, z = up.T
    with np.errstate(invalid="ignore"):
        return np.column_stack([np.arctan2(y, z), -np.arcsin(np.clip(x, -1.0, 1.0))])


def vertical_rate(rates: Floats, roll: float, pitch: float) -> float:
    """Yaw rate about the vertical from the rates (3,) about a base's axes [rad/s].

    If the attitude is nan or implausible, the rate about the base's z axis.
    """
    if not max(abs(roll), abs(pitch)) <= MAX_PLAUSIBLE_TILT:
        roll = pitch = 0.0
    return float((math.sin(roll) * rates[1] + math.cos(roll) * rates[2]) / math.cos(pitch))


def vertical_of(orientation: Floats) -> Floats:
    """The vertical (n, 3) in the axes of bodies with orientations (n, 4) in a level frame."""
    with np.errstate(invalid="ignore"):
        x, y, z, w = (orientation / np.linalg.norm(orientation, axis=1, keepdims=True)).T
    return np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])


def headings(orientation: Floats) -> Floats:
    """Headings (n,) [rad] of quaternions (n, 4) of any norm."""
    x, y, z, w = orientation.T
    found: Floats = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return found
