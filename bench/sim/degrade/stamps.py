"""Timing: missing or blind scans, a faster robot, wrong stamps."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.degrade.degradation import degradation
from bench.sim.degrade.spells import at_rate, spell
from slams.scanlog import ScanLog, TimeSeries
from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator


@degradation("s", (1, 2, 3, 5, 8), 0, 3600)
def gap(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Scans missing in the middle.

    Odometry and gyro continue. A log that is not longer keeps its first scan.
    """
    return log.rows(~spell(log.t, level, rng))


@degradation("s", (1, 2, 3, 5, 8), 0, 3600)
def blind(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Scans without returns, all inf, in the middle."""
    ranges = np.array(log.ranges)
    ranges[spell(log.t, level, rng)] = np.inf
    return replace(log, ranges=ranges)


@degradation("x", (2, 3, 4, 6, 8, 12), 1, 100)
def speed(log: ScanLog, level: float) -> ScanLog:
    """Factor of the speed on the same path, with the same laser.

    Stamps are closer, turn rates are greater, and scans are left out to keep the scan rate.
    """
    start, period = float(log.t[0]), log.scan_period
    hurried = replace(
        log,
        t=_sooner(log.t, start, level),
        laser=replace(log.laser, time_increment=log.laser.time_increment / level),
        odom=_hurried(log.odom, start, level),
        truth=_hurried(log.truth, start, level),
        yaw_rate=_hurried(log.yaw_rate, start, level, level),
        attitude=_hurried(log.attitude, start, level),
    )
    return hurried.rows(at_rate(hurried.t, 1.0 / period)) if period > 0.0 else hurried


def _hurried(
    series: TimeSeries | None, start: float, level: float, rate: float = 1.0
) -> TimeSeries | None:
    return series and TimeSeries(_sooner(series.t, start, level), rate * series.values)


def _sooner(t: Floats, start: float, level: float) -> Floats:
    return np.asarray(start + (t - start) / level)


@degradation("ms", (10, 20, 50, 100, 200), 0, 60000)
def jitter(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Standard deviation of the scans' stamps.

    Some stamps jump back. Odometry and gyro keep theirs. The ground truth moves with the scans (one
    pose for each), so that errors refer to the true pose of the measurement.
    """
    t, truth = log.t + rng.normal(0.0, 1e-3 * level, len(log)), log.truth_at(log.t)
    if truth is None:
        return replace(log, t=t)
    known = np.isfinite(truth[:, 0])
    return replace(log, t=t, truth=TimeSeries(t[known], truth[known]) if known.any() else None)


@degradation("ms", (50, 100, 200, 500, 1000), 0, 60000, needs=("odometry",))
def lag(log: ScanLog, level: float) -> ScanLog:
    """Delay of the scans' stamps against odometry and gyro; the ground truth moves with them."""
    delay = 1e-3 * level
    truth = log.truth and TimeSeries(log.truth.t + delay, log.truth.values)
    return replace(log, t=log.t + delay, truth=truth)
