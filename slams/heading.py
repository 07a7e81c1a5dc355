"""The heading of a robot whose gyro tells rates, reading by reading."""

from __future__ import annotations

import math

from slams.validation import LATEST, can_be

LONGEST_GAP = 0.5  # s without a yaw rate that may still be bridged


class Heading:
    """The heading integrated from the gyro's readings."""

    def __init__(self) -> None:
        self._t, self._rate, self._yaw = math.nan, 0.0, 0.0

    def push(self, t: float, rate: float) -> None:
        """Take one reading [rad/s]."""
        step = t - self._t
        late = -LONGEST_GAP <= step < 0.0  # further back the clock was set back
        if late or not (abs(t) < LATEST and can_be(rate)):
            return
        if 0.0 < step <= LONGEST_GAP:
            self._yaw += 0.5 * step * (self._rate + rate)
        self._t, self._rate = t, rate

    def at(self, t: float) -> float | None:
        """The heading at a stamp close to the last reading; None where there is none."""
        step = t - self._t
        return self._yaw + step * self._rate if abs(step) <= LONGEST_GAP else None
