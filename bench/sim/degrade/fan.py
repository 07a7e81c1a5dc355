"""A poorer laser: lower rate, fewer beams, narrower field of view, slower mirror."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from bench.sim.degrade.degradation import degradation
from bench.sim.degrade.spells import at_rate, elapsed
from slams.scanlog import ScanLog

MIN_SCANS_PER_TURN = 4.0  # scans of the log, to compose a scan of a turning laser


@degradation("Hz", (5, 3, 2, 1, 0.5, 0.25), 0.01, 1000)
def rate(log: ScanLog, level: float) -> ScanLog:
    """Scans per second; a slower log keeps all scans.

    The kept scans are those nearest to an even rate. Odometry and gyro do not change.
    """
    return log.rows(at_rate(log.t, level))


@degradation("1", (180, 90, 60, 45, 30, 20, 12, 8), 1, 100_000, whole=True)
def beams(log: ScanLog, level: float) -> ScanLog:
    """Beams of a scan, evenly over the whole fan.

    Every k-th beam, with the k that gives the number nearest to `level`.
    """
    n = log.laser.n_beams
    if level >= n:
        return log
    every = min(
        (math.floor(n / level), math.ceil(n / level)), key=lambda k: abs(_left(n, k) - level)
    )
    left = _left(n, every)
    left -= left == level + 1  # a fan of n intervals has n + 1 beams
    first = (n - 1 - (left - 1) * every) // 2
    return _part(log, slice(first, first + (left - 1) * every + 1, every))


@degradation("deg", (180, 120, 90, 60, 45, 30, 20), 1, 360)
def fov(log: ScanLog, level: float) -> ScanLog:
    """Field of view, about the middle of the fan."""
    n, step = log.laser.n_beams, abs(log.laser.angle_increment)
    if step * (n - 1) <= math.radians(level):
        return log
    max_beams = math.floor(math.radians(level) / step + 1e-9) + 1
    left = max(1, max_beams - (n - max_beams) % 2)  # removes as many beams on both sides
    first = (n - left) // 2
    return _part(log, slice(first, first + left))


@degradation("Hz", (10, 5, 3, 2, 1), 0.01, 1000)
def sweep(log: ScanLog, level: float) -> ScanLog:
    """Turns per second of a mirror that measures beam after beam.

    The scans are composed from a faster log. Beam j is measured `j * time_increment` after the
    stamp, when the mirror reaches its angle. Its reading is that of the scan nearest in time, so
    its time error is at most half a period of the faster log.

    Raises:
        ValueError: the scan rate of the log is too low.
    """
    if log.scan_period * level * MIN_SCANS_PER_TURN > 1.0 + 1e-6 or len(log) < 2:
        have = f"{1.0 / log.scan_period:.3g} Hz" if log.scan_period > 0.0 else "no rate"
        raise ValueError(
            f"sweep: {level:g} turns per second need scans at {MIN_SCANS_PER_TURN * level:g} Hz"
            f" or more, and this log has {have}; give a lower level or a faster log"
        )
    laser, clock = log.laser, elapsed(log.t)
    per_beam = abs(laser.angle_increment) / (2.0 * math.pi * level)
    beam = np.arange(laser.n_beams)
    rows = at_rate(log.t, level)
    whole = clock[rows] + per_beam * beam[-1] <= clock[-1] + 0.5 * log.scan_period
    rows = rows[whole | (rows == 0)]
    wanted = clock[rows, None] + (per_beam - laser.time_increment) * beam
    middles = 0.5 * (clock[1:] + clock[:-1])
    nearest = np.searchsorted(middles, wanted)
    turning = replace(laser, time_increment=per_beam)
    return replace(log.rows(rows), ranges=log.ranges[nearest, beam], laser=turning)


def _left(n: int, every: int) -> int:
    """Number of beams left if every k-th of n is kept."""
    return 1 + (n - 1) // every


def _part(log: ScanLog, part: slice) -> ScanLog:
    """Some beams of every scan; the stamp is that of the first of them."""
    first, _, every = part.indices(log.laser.n_beams)
    ranges, laser = log.ranges[:, part], log.laser
    part_of_it = replace(
        laser,
        angle_min=laser.angle_min + first * laser.angle_increment,
        angle_increment=laser.angle_increment * every,
        n_beams=ranges.shape[1],
        time_increment=laser.time_increment * every,
    )
    return replace(log, t=log.t + first * laser.time_increment, ranges=ranges, laser=part_of_it)
