"""Attitude of the base from the messages of an IMU that is mounted anyhow."""

import math

import numpy as np
import pytest

from slams.formats.messages import imu_series
from slams.ros.attitude import GRAVITY, vertical_rate
from slams.ros.maker import Maker
from slams.ros.messages import ImuReading, imu_reading
from slams.types import Attitude

NONE = (math.nan,) * 4
T = np.arange(0.0, 10.0, 0.01)
TURNED = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # an IMU that looks left


def true(t):
    return Attitude(0.15 * math.sin(t), 0.1 * math.sin(1.7 * t + 0.5))


def quaternion(matrix):
    w = 0.5 * math.sqrt(1.0 + np.trace(matrix))
    a, b, c = matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]
    return a / (4.0 * w), b / (4.0 * w), c / (4.0 * w), w


def messages(orientation):
    """What an IMU gives of `true`, with its orientation, or with rates and acceleration alone."""
    rows, h = [], 1e-5
    for t in T.tolist():
        R, later = (true(at).rotation() @ TURNED for at in (t, t + h))
        spin = R.T @ (later - R) / h
        rates = float(spin[2, 1]), float(spin[0, 2]), float(spin[1, 0])
        force = (0.0, 0.0, 0.0) if orientation else tuple((GRAVITY * R[2]).tolist())
        rows.append(ImuReading(t, quaternion(R) if orientation else NONE, rates, force))
    return rows


@pytest.mark.parametrize(("orientation", "error"), [(True, 1e-9), (False, 2e-3)])
def test_roll_and_pitch_of_the_base(orientation, error):
    _, track = imu_series(T, messages(orientation), TURNED)
    np.testing.assert_allclose(track.values, [true(t) for t in T.tolist()], atol=error)


def test_without_gyro_or_gravity_there_is_none():
    t = np.array([0.0, 1.0])
    nothing = [ImuReading(one, NONE, (0.0,) * 3, (0.0,) * 3) for one in t.tolist()]
    rate, attitude = imu_series(t, nothing, np.eye(3))
    assert attitude is None and rate.values.tolist() == [0.0, 0.0]
    assert imu_series(t[:0], [], np.eye(3)) == (None, None)


@pytest.mark.parametrize("w", [0.0, 1.0])
def test_an_orientation_that_nobody_filled_in_is_none(w):
    message = Maker().imu(10**9, 0.5, "imu")
    message.orientation.w, message.orientation_covariance[0] = w, 0.0
    assert np.isnan(imu_reading(message).orientation).all()
    message.orientation.z = 1e-3
    assert imu_reading(message).orientation == (0.0, 0.0, 1e-3, w)


def test_a_shaken_accelerometer_is_left_out_and_its_noise_averaged():
    rows, shaken = messages(False), []
    for k, row in enumerate(rows):
        x, y, z = row.acceleration
        noise = 0.8 * (-1) ** k if k else 0.0
        noisy = (0.0, 15.0, 9.81) if row.stamp > 5.0 else (x, y + noise, z)
        shaken.append(row._replace(acceleration=noisy))
    _, track = imu_series(T, shaken, TURNED)
    np.testing.assert_allclose(track.values, [true(t) for t in T.tolist()], atol=0.02)


def test_the_turn_rate_is_about_the_vertical():
    """A base that turns by 0.5 rad/s about the vertical, and pitches besides."""
    roll, pitch, turn, pitching = 0.2, -0.3, 0.5, 0.4
    R = Attitude(roll, pitch).rotation()
    axis = np.array([0.0, math.cos(roll), -math.sin(roll)])  # of pitch, seen from the base
    rates = R.T @ (0.0, 0.0, turn) + pitching * axis
    assert vertical_rate(rates, roll, pitch) == pytest.approx(turn)
