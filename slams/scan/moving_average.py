"""MovingAverage: a mean of recent measurements, weighted by time."""

from __future__ import annotations

import math

MAX_WEIGHT_TIME = 0.1  # s that one scan counts at most: the mean needs several rare scans
FRESH_TIME = 0.08  # s without a new measurement: at 40 Hz one scan in four is measured


class MovingAverage:
    """Exponential moving average with a time constant in seconds: the same at 10 and at 40 Hz.

    The first scans have equal weights. Below 10 Hz as many scans count as at 10 Hz.

    Args:
        seconds: time constant [s], in which the weight of a scan falls to 1/e.
        value: the value before the first measurement.
        prior: number of scans for which it counts.
    """

    def __init__(self, seconds: float, value: float = 0.0, prior: float = 0.0) -> None:
        self.value = value
        self._seconds = seconds
        self._t = -math.inf
        self._scans = prior

    def is_fresh(self, t: float) -> bool:
        """Whether the last measurement is recent at the time `t` [s]."""
        return 0.0 <= t - self._t < FRESH_TIME

    def add(self, value: float, t: float) -> None:
        """Add the measurement of the scan of time `t` [s], once per scan; unless `t` is nan."""
        if t == self._t or not math.isfinite(t):
            return
        self._scans += 1
        dt = min(max(t - self._t, 0.0), MAX_WEIGHT_TIME)
        weight = max(1.0 - math.exp(-dt / self._seconds), 1.0 / self._scans)
        self.value += weight * (value - self.value)
        self._t = t
