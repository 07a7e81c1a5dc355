"""Poorer readings: shorter range, noise, bias, dropouts, short readings, quantization."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.degrade import fan
from bench.sim.degrade.degradation import degradation
from bench.sim.range_errors import Errors
from slams.scanlog import ScanLog
from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator

EXACT_READINGS = Errors(noise=0.0, step=0.0)


@degradation("m", (8, 6, 4, 3, 2, 1.5, 1), 0.1, 1000)
def range_(log: ScanLog, level: float) -> ScanLog:
    """Maximum range of the laser.

    Raises:
        ValueError: it is below the minimum range.
    """
    nearest = log.laser.range_min
    if level <= nearest:
        raise ValueError(
            f"range: got {level:g} m, expected more than the laser's minimum range of {nearest:g} m"
        )
    laser = replace(log.laser, range_max=min(level, log.laser.range_max))
    return replace(log, laser=laser)


@degradation("m", (0.05, 0.1, 0.2, 0.3, 0.5, 0.8), 0, 10)
def noise(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Standard deviation of Gaussian noise added to each reading."""
    return _measured(log, replace(EXACT_READINGS, noise=level), rng)


@degradation("m", (0.05, 0.1, 0.2, 0.5, 1), -10, 10)
def bias(log: ScanLog, level: float) -> ScanLog:
    """Added to each reading."""
    return replace(log, ranges=log.ranges + np.float32(level))


@degradation("%", (2, 5, 10, 20, 40), -90, 1000)
def scale(log: ScanLog, level: float) -> ScanLog:
    """Each reading is too long by this share."""
    return replace(log, ranges=log.ranges * np.float32(1.0 + 0.01 * level))


@degradation("%", (50, 70, 80, 90, 95, 98), 0, 100)
def dropout(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Readings lost at random, half inf, half nan."""
    return _measured(log, replace(EXACT_READINGS, dropout=0.01 * level), rng)


@degradation("%", (30, 50, 70, 80, 90, 95), 0, 100)
def short(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Readings that end at random before the wall: rain, dust, smoke.

    They end anywhere between the laser and its reading, or up to the maximum range if there was no
    return.
    """
    chance, share = rng.random((2, *log.ranges.shape), np.float32)
    least, most = np.float32(log.laser.range_min), np.float32(log.laser.range_max)
    full = np.minimum(log.ranges, most)  # nan stays
    return replace(
        log,
        ranges=np.where(chance < 0.01 * level, least + share * (full - least), log.ranges),
    )


@degradation("m", (0.05, 0.1, 0.2, 0.5, 1), 0, 10)
def quantization(log: ScanLog, level: float) -> ScanLog:
    """Readings are rounded to multiples of the level."""
    return _measured(log, replace(EXACT_READINGS, step=level), np.random.default_rng(0))


@degradation("1", (1,), 1, 1)
def poor_lidar(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """A cheap scanner: 5 Hz, 360 beams, 3.5 m, 22 mm of noise, 10 % dropouts; level 1."""
    log = range_(fan.beams(fan.rate(log, 5.0), 360), 3.5)
    return _measured(log, replace(EXACT_READINGS, noise=0.022, dropout=0.1), rng)


def _measured(log: ScanLog, errors: Errors, rng: Generator) -> ScanLog:
    distances: Floats = log.ranges.astype(np.float64)
    return replace(log, ranges=errors.apply(distances, rng).astype(np.float32))
