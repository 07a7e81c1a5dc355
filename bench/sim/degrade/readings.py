"""Poorer readings: cut, noisy, wrong, lost, short or coarse."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.degrade import fan
from bench.sim.range_errors import Errors
from slams.scanlog import ScanLog
from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator

EXACT = Errors(noise=0.0, step=0.0)


def cut(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """The laser sees no further than `level` [m].

    Raises:
        ValueError: that is nearer than it sees at all.
    """
    nearest = log.laser.range_min
    if level <= nearest:
        raise ValueError(
            f"range: got {level:g} m, expected more than the {nearest:g} m from which on this"
            " laser sees"
        )
    laser = replace(log.laser, range_max=min(level, log.laser.range_max))
    return replace(log, laser=laser)


def noise(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Gaussian noise of the standard deviation `level` [m] on top of what there is."""
    return _measured(log, replace(EXACT, noise=level), rng)


def bias(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Every reading `level` [m] too long."""
    return replace(log, ranges=log.ranges + np.float32(level))


def scale(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Every reading `level` [%] too long."""
    return replace(log, ranges=log.ranges * np.float32(1.0 + 0.01 * level))


def dropouts(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """`level` [%] of the readings lost by chance, half as "nothing there", half as not valid."""
    return _measured(log, replace(EXACT, dropout=0.01 * level), rng)


def short(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """`level` [%] of the readings, by chance, anywhere between the laser and what it saw.

    Rain, dust, smoke, leaves. A beam that saw nothing may be short of its greatest range.
    """
    struck, share = rng.random((2, *log.ranges.shape), np.float32)
    least, most = np.float32(log.laser.range_min), np.float32(log.laser.range_max)
    seen = np.minimum(log.ranges, most)  # nan stays
    return replace(
        log,
        ranges=np.where(struck < 0.01 * level, least + share * (seen - least), log.ranges),
    )


def quantization(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """Readings rounded to multiples of `level` [m]."""
    return _measured(log, replace(EXACT, step=level), rng)


def poor_lidar(log: ScanLog, level: float, rng: Generator) -> ScanLog:
    """What a cheap turning scanner has left: 5 Hz, 360 beams, 3.5 m, 22 mm noise, 10 % dropouts."""
    log = cut(fan.beams(fan.rate(log, 5.0, rng), 360, rng), 3.5, rng)
    return _measured(log, replace(EXACT, noise=0.022, dropout=0.1), rng)


def _measured(log: ScanLog, errors: Errors, rng: Generator) -> ScanLog:
    distances: Floats = log.ranges.astype(np.float64)
    return replace(log, ranges=errors.apply(distances, rng).astype(np.float32))
