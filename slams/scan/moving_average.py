"""A moving average over seconds: what scans were like lately."""

from __future__ import annotations

import math

MAX_WEIGHT_TIME = 0.1  # s that one scan counts for at most: two or three rare scans are chance
FRESH_TIME = 0.08  # s for which a measurement need not be repeated: at 40 Hz one scan in four


class MovingAverage:
    """A mean that forgets in seconds, not in scans: the same at 10 and at 40 Hz.

    Where scans are rarer it is of as many as at 10 Hz; of the first scans it is the plain mean.

    Args:
        seconds: the time constant: the weight of a scan falls to 1/e in it [s].
        value: the value until something was measured.
    """

    def __init__(self, seconds: float, value: float = 0.0) -> None:
        self.value = value
        self._seconds = seconds
        self._t = -math.inf
        self._scans = 0

    def is_fresh(self, t: float) -> bool:
        """Whether the last measurement is recent enough at the time `t` [s]."""
        return 0.0 <= t - self._t < FRESH_TIME

    def learn(self, value: float, t: float) -> None:
        """Take the measurement of the scan of time `t` [s], once per scan."""
        if t == self._t:
            return
        self._scans += 1
        dt = min(max(t - self._t, 0.0), MAX_WEIGHT_TIME)
        weight = max(1.0 - math.exp(-dt / self._seconds), 1.0 / self._scans)
        self.value += weight * (value - self.value)
        self._t = t
