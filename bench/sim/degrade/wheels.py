"""Wheels that slip, stall, jump or are wrong for good, and a gyro with a bias."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.degrade.spells import elapsed, moment, spell
from bench.sim.wheels import integrate, steps
from slams.scanlog import ScanLog, Track
from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator

TRACK = 0.4  # m, from the left wheels to the right ones: a rescue robot's
SLIPPERY = 0.3  # share of the time that a side's wheels slip, by chance every second anew
SPELLS = 3600  # after which the draws repeat
TWIST = 0.2  # rad, at most, that a jump turns the robot for each meter


def slip(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Wheels turn `level` [%] further than they roll, in spells of 1 s, 30 % of the time.

    Left and right for themselves, 0.4 m apart, so that the heading suffers most.
    """
    odom, (ahead, aside, turn) = _increments(log)
    second = elapsed(odom.t)[1:].astype(np.int64) % SPELLS
    slips = (rng.random((2, SPELLS)) < SLIPPERY)[:, second]
    left = (1.0 + 0.01 * level * slips[0]) * (ahead - 0.5 * TRACK * turn)
    right = (1.0 + 0.01 * level * slips[1]) * (ahead + 0.5 * TRACK * turn)
    return _counted(log, 0.5 * (left + right), aside, (right - left) / TRACK)


def stall(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """For `level` [s] in the middle the wheels count nothing, though the robot moves."""
    odom, (ahead, aside, turn) = _increments(log)
    rolls = ~spell(odom.t, level, rng)[1:]
    return _counted(log, rolls * ahead, rolls * aside, rolls * turn)


def jump(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Once in the middle, odometry jumps `level` [m] in any direction and turns, too."""
    odom, (ahead, aside, turn) = _increments(log)
    direction, twist = rng.uniform(-math.pi, math.pi), TWIST * level * rng.uniform(-1.0, 1.0)
    last = moment(odom.t, rng) - 1
    if last >= 0:
        ahead[last] += level * math.cos(direction)
        aside[last] += level * math.sin(direction)
        turn[last] += twist
    return _counted(log, ahead, aside, turn)


def wheel_scale(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Wheels are `level` [%] smaller than believed: way and turns are counted too long."""
    _, (ahead, aside, turn) = _increments(log)
    factor = 1.0 + 0.01 * level
    return _counted(log, factor * ahead, factor * aside, factor * turn)


def wheel_rate(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """The wheels tell where they are `level` times a second; in between it is their last value.

    So do recorders that give a scan the last message of the wheels, out of step with the laser.
    """
    assert log.odom is not None, "the catalog says that this needs odometry"
    tick = np.floor(elapsed(log.odom.t) * level + rng.uniform())
    known = np.searchsorted(tick, tick)
    return replace(log, odom=Track(log.odom.t, log.odom.values[known]))


def heading_bias(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Odometry turns `level` [deg] to the left for each meter driven."""
    _, (ahead, aside, turn) = _increments(log)
    return _counted(log, ahead, aside, turn + math.radians(level) * np.hypot(ahead, aside))


def gyro_bias(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """The gyro's turn rate is `level` [deg/s] too large."""
    assert log.yaw_rate is not None, "the catalog says that this needs a gyro"
    rate = log.yaw_rate.values + math.radians(level)
    return replace(log, yaw_rate=Track(log.yaw_rate.t, rate))


def _increments(log: ScanLog) -> tuple[Track, tuple[Floats, Floats, Floats]]:
    """Odometry as recorded, and its steps ahead, aside [m] and turns [rad], fresh arrays."""
    assert log.odom is not None, "the catalog says that this needs odometry"
    return log.odom, steps(log.odom.values)


def _counted(log: ScanLog, ahead: Floats, aside: Floats, turn: Floats) -> ScanLog:
    """The log with odometry of these increments, from the pose where it began."""
    assert log.odom is not None
    poses = integrate(ahead, aside, turn, log.odom.values[0])
    return replace(log, odom=Track(log.odom.t, poses))
