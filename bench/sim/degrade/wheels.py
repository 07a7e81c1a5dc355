"""Wheels that slip, stall, jump or are wrong for good, and a gyro with a bias."""

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

TRACK = 0.4  # m, from the left wheels to the right ones: a rescue robot's
SLIPPERY = 0.3  # share of the time that a side's wheels slip, by chance every second anew
SPELLS = 3600  # after which the draws repeat
TWIST = 0.2  # rad, at most, that a jump turns the robot for each meter


@degradation("%", (10, 20, 50, 100, 200), 0, 1000, needs=("odometry",))
def slip(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Wheels turn further than they roll, 30 % of the time.

    In spells of 1 s, left and right for themselves, 0.4 m apart, so that the heading suffers most.
    """
    odom, (ahead, aside, turn) = _increments(log)
    second = elapsed(odom.t)[1:].astype(np.int64) % SPELLS
    slips = (rng.random((2, SPELLS)) < SLIPPERY)[:, second]
    left = (1.0 + 0.01 * level * slips[0]) * (ahead - 0.5 * TRACK * turn)
    right = (1.0 + 0.01 * level * slips[1]) * (ahead + 0.5 * TRACK * turn)
    return _counted(log, 0.5 * (left + right), aside, (right - left) / TRACK)


@degradation("s", (1, 2, 3, 5, 8), 0, 3600, needs=("odometry",))
def stall(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """In the middle the wheels count nothing.

    The robot moves all the same.
    """
    odom, (ahead, aside, turn) = _increments(log)
    rolls = ~spell(odom.t, level, rng)[1:]
    return _counted(log, rolls * ahead, rolls * aside, rolls * turn)


@degradation("m", (0.5, 1, 2, 5, 10), 0, 1000, needs=("odometry",))
def jump(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """One jump of the odometry in the middle.

    In any direction; the robot turns, too.
    """
    odom, (ahead, aside, turn) = _increments(log)
    direction, twist = rng.uniform(-math.pi, math.pi), TWIST * level * rng.uniform(-1.0, 1.0)
    last = moment(odom.t, rng) - 1
    if last >= 0:
        ahead[last] += level * math.cos(direction)
        aside[last] += level * math.sin(direction)
        turn[last] += twist
    return _counted(log, ahead, aside, turn)


@degradation("%", (5, 15, 25, 50, 100), -90, 1000, needs=("odometry",))
def wheel_scale(log: ScanLog, level: float) -> ScanLog:
    """Way and turns counted too long by that much.

    Wheels are smaller than believed.
    """
    _, (ahead, aside, turn) = _increments(log)
    factor = 1.0 + 0.01 * level
    return _counted(log, factor * ahead, factor * aside, factor * turn)


@degradation("Hz", (10, 5, 3, 2, 1), 0.1, 1e6, needs=("odometry",))
def wheel_rate(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Wheels tell their pose that often; until then the last is given again.

    So do recorders that give a scan the last message of the wheels, out of step with the laser.
    """
    assert log.odom is not None, "the catalog says that this needs odometry"
    tick = np.floor(elapsed(log.odom.t) * level + rng.uniform())
    known = np.searchsorted(tick, tick)
    return replace(log, odom=TimeSeries(log.odom.t, log.odom.values[known]))


@degradation("deg/m", (2, 5, 10, 20, 40), -360, 360, needs=("odometry",))
def heading_bias(log: ScanLog, level: float) -> ScanLog:
    """Odometry turns left by that much for each meter."""
    _, (ahead, aside, turn) = _increments(log)
    return _counted(log, ahead, aside, turn + math.radians(level) * np.hypot(ahead, aside))


@degradation("deg/s", (0.5, 2, 5, 10, 20), -360, 360, needs=("gyro",))
def gyro_bias(log: ScanLog, level: float) -> ScanLog:
    """Added to the turn rate."""
    assert log.yaw_rate is not None, "the catalog says that this needs a gyro"
    rate = log.yaw_rate.values + math.radians(level)
    return replace(log, yaw_rate=TimeSeries(log.yaw_rate.t, rate))


def _increments(log: ScanLog) -> tuple[TimeSeries, tuple[Floats, Floats, Floats]]:
    """Odometry as recorded, and its steps ahead, aside [m] and turns [rad], fresh arrays."""
    assert log.odom is not None, "the catalog says that this needs odometry"
    return log.odom, steps(log.odom.values)


def _counted(log: ScanLog, ahead: Floats, aside: Floats, turn: Floats) -> ScanLog:
    """The log with odometry of these increments, from the pose where it began."""
    assert log.odom is not None
    poses = integrate(ahead, aside, turn, log.odom.values[0])
    return replace(log, odom=TimeSeries(log.odom.t, poses))
