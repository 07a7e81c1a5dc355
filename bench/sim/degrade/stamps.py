"""Trouble with time: scans missing or blind, a robot in a hurry, stamps that are not right."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.degrade.spells import at_rate, spell
from slams.scanlog import ScanLog, Track
from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator


def gap(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Scans of `level` [s] in the middle are missing; wheels and gyro go on where they have more.

    A log that is no longer than that keeps its first scan.
    """
    return log.rows(~spell(log.t, level, rng))


def blind(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """For `level` [s] in the middle the laser sees nothing: the scans are there, all inf."""
    ranges = np.array(log.ranges)
    ranges[spell(log.t, level, rng)] = np.inf
    return replace(log, ranges=ranges)


def speed(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """The robot drives the same way `level` times as fast under the same laser.

    All stamps lie closer, turn rates are greater, and as the laser measures no more often than it
    did, scans are left out.
    """
    start, period = float(log.t[0]), log.scan_period
    hurried = replace(
        log,
        t=_sooner(log.t, start, level),
        laser=replace(log.laser, time_increment=log.laser.time_increment / level),
        odom=_hurried(log.odom, start, level),
        truth=_hurried(log.truth, start, level),
        yaw_rate=_hurried(log.yaw_rate, start, level, level),
    )
    return hurried.rows(at_rate(hurried.t, 1.0 / period)) if period > 0.0 else hurried


def _hurried(track: Track | None, start: float, level: float, rate: float = 1.0) -> Track | None:
    return track and Track(_sooner(track.t, start, level), rate * track.values)


def _sooner(t: Floats, start: float, level: float) -> Floats:
    return np.asarray(start + (t - start) / level)


def jitter(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Each scan's stamp is off by chance, with the standard deviation `level` [ms]; some jump back.

    Wheels and gyro keep theirs. The truth goes with the scans (one pose for each), so that a pose
    is held against where its scan was measured.
    """
    t, truth = log.t + rng.normal(0.0, 1e-3 * level, len(log)), log.truth_at(log.t)
    if truth is None:
        return replace(log, t=t)
    known = np.isfinite(truth[:, 0])
    return replace(log, t=t, truth=Track(t[known], truth[known]) if known.any() else None)


def lag(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Scans are stamped `level` [ms] late against wheels and gyro; the truth goes with them."""
    late = 1e-3 * level
    truth = log.truth and Track(log.truth.t + late, log.truth.values)
    return replace(log, t=log.t + late, truth=truth)
