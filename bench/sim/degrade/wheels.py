"""Faults of odometry and gyro: slip, stall, jump, scale, rate, bias."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.degrade.degradation import degradation
from bench.sim.degrade.spells import elapsed, moment, spell
from bench.sim.wheels import integrate, steps
from slams.scanlog import ScanLog, TimeSeries
from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator

TRACK_WIDTH = 0.4  # m between left and right wheels, of a rescue robot
SLIP_SHARE = 0.3  # of the time, drawn every second for each side
SLIP_PERIOD = 3600  # s after which the draws repeat
JUMP_ROTATION_PER_METER = 0.2  # rad, maximum


@degradation("%", (10, 20, 50, 100, 200), 0, 1000, needs=("odometry",))
def slip(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Excess of the measured wheel motion, 30 % of the time.

    Slip lasts 1 s and is independent for left and right wheels, 0.4 m apart.
    """
    odom, (longitudinal, lateral, rotation) = _increments(log)
    second = elapsed(odom.t)[1:].astype(np.int64) % SLIP_PERIOD
    slips = (rng.random((2, SLIP_PERIOD)) < SLIP_SHARE)[:, second]
    left = (1.0 + 0.01 * level * slips[0]) * (longitudinal - 0.5 * TRACK_WIDTH * rotation)
    right = (1.0 + 0.01 * level * slips[1]) * (longitudinal + 0.5 * TRACK_WIDTH * rotation)
    return _counted(log, 0.5 * (left + right), lateral, (right - left) / TRACK_WIDTH)


@degradation("s", (1, 2, 3, 5, 8), 0, 3600, needs=("odometry",))
def stall(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Odometry stands still in the middle, while the robot moves."""
    odom, (longitudinal, lateral, rotation) = _increments(log)
    rolls = ~spell(odom.t, level, rng)[1:]
    return _counted(log, rolls * longitudinal, rolls * lateral, rolls * rotation)


@degradation("m", (0.5, 1, 2, 5, 10), 0, 1000, needs=("odometry",))
def jump(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """One jump of the odometry in the middle, with random direction and rotation."""
    odom, (longitudinal, lateral, rotation) = _increments(log)
    direction = rng.uniform(-math.pi, math.pi)
    jump_rotation = JUMP_ROTATION_PER_METER * level * rng.uniform(-1.0, 1.0)
    last = moment(odom.t, rng) - 1
    if last >= 0:
        longitudinal[last] += level * math.cos(direction)
        lateral[last] += level * math.sin(direction)
        rotation[last] += jump_rotation
    return _counted(log, longitudinal, lateral, rotation)


@degradation("%", (5, 15, 25, 50, 100), -90, 1000, needs=("odometry",))
def wheel_scale(log: ScanLog, level: float) -> ScanLog:
    """Distances and rotations are too large by this share, as for a wrong wheel radius."""
    _, (longitudinal, lateral, rotation) = _increments(log)
    factor = 1.0 + 0.01 * level
    return _counted(log, factor * longitudinal, factor * lateral, factor * rotation)


@degradation("Hz", (10, 5, 3, 2, 1), 0.1, 1e6, needs=("odometry",))
def wheel_rate(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Rate of new odometry poses; in between the last one is repeated.

    As in recordings that give each scan the last odometry message.
    """
    assert log.odom is not None, "this needs odometry"
    tick = np.floor(elapsed(log.odom.t) * level + rng.uniform())
    known = np.searchsorted(tick, tick)
    return replace(log, odom=TimeSeries(log.odom.t, log.odom.values[known]))


@degradation("deg/m", (2, 5, 10, 20, 40), -360, 360, needs=("odometry",))
def heading_bias(log: ScanLog, level: float) -> ScanLog:
    """Heading drift of the odometry per meter, to the left."""
    _, (longitudinal, lateral, rotation) = _increments(log)
    drift = math.radians(level) * np.hypot(longitudinal, lateral)
    return _counted(log, longitudinal, lateral, rotation + drift)


@degradation("deg/s", (0.5, 2, 5, 10, 20), -360, 360, needs=("gyro",))
def gyro_bias(log: ScanLog, level: float) -> ScanLog:
    """Bias added to the turn rate."""
    assert log.yaw_rate is not None, "this needs a gyro"
    rate = log.yaw_rate.values + math.radians(level)
    return replace(log, yaw_rate=TimeSeries(log.yaw_rate.t, rate))


def _increments(log: ScanLog) -> tuple[TimeSeries, tuple[Floats, Floats, Floats]]:
    """Recorded odometry, and new arrays of its longitudinal, lateral [m], rotation [rad] steps."""
    assert log.odom is not None, "this needs odometry"
    return log.odom, steps(log.odom.values)


def _counted(log: ScanLog, longitudinal: Floats, lateral: Floats, rotation: Floats) -> ScanLog:
    """The log with odometry of these increments, from its first pose on."""
    assert log.odom is not None
    poses = integrate(longitudinal, lateral, rotation, log.odom.values[0])
    return replace(log, odom=TimeSeries(log.odom.t, poses))
