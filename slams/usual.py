"""Usual: what scans were like in the last seconds."""

from __future__ import annotations

import math

LONGEST = 0.1  # s that one scan counts for: what two or three scans say is chance
FRESH = 0.08  # s for which what a scan showed need not be looked at again: of 40 Hz one in four


class Usual:
    """A mean that forgets in seconds, not in scans: at 10 and at 40 Hz the same is usual.

    Where scans are rarer it is of as many as at 10 Hz; of the first it is the plain mean.

    Args:
        seconds: after which what was seen counts by the e-th part [s].
        value: what is usual until something was seen.
    """

    def __init__(self, seconds: float, value: float = 0.0) -> None:
        self.value = value
        self._seconds = seconds
        self._t = -math.inf
        self._scans = 0

    def is_fresh(self, t: float) -> bool:
        """Whether a scan has been looked at so shortly before the time `t` [s] that it will do."""
        return 0.0 <= t - self._t < FRESH

    def learn(self, value: float, t: float, least: float = 0.0) -> None:
        """Take in what the scan of time `t` [s] shows, unless it was looked at before.

        `least` is the share that it counts by at least.
        """
        if t == self._t:
            return
        self._scans += 1
        forgotten = 1.0 - math.exp(-min(max(t - self._t, 0.0), LONGEST) / self._seconds)
        share = 1.0 if self._scans == 1 else max(forgotten, least, 1.0 / self._scans)
        self.value += share * (value - self.value)
        self._t = t
