"""Odometry and gyro as they come, looked up at a scan's stamp exactly as a recorded log's are.

The sums are those of `slams.time_series`, one by one: a run of the recording gives the poses of
the live run, bit for bit.
"""

from __future__ import annotations

import math
import time
from bisect import bisect_left

import numpy as np

from slams.live.estimate import LATE_IN_A_ROW
from slams.types import Pose2, wrap_angle
from slams.validation import MAX_STAMP, is_plausible

MAX_SAMPLES = 2000  # at least as many are kept: 10 s at 200 Hz
MAX_SILENCE = 1.0  # [s] after the last sample; then no scan waits for the next


class Series:
    """Rows of numbers by stamp, interpolated and never extrapolated.

    `received` [s] is when, on this machine's clock, the last sample came. A sample that is not
    newer than the one before is left out; after many of them the series begins anew.

    Args:
        max_gap: between two samples, beyond which nothing is known in between [s].
    """

    def __init__(self, max_gap: float = math.inf) -> None:
        self.t: list[float] = []
        self.rows: list[tuple[float, ...]] = []
        self.received = -math.inf
        self._max_gap, self._late_in_a_row = max_gap, 0

    def push(self, t: float, *values: float) -> None:
        """Take a sample; one that no robot can have is left out."""
        if not is_plausible(*values):
            return
        self.received = time.monotonic()
        self._late_in_a_row = self._late_in_a_row + 1 if self.t and t <= self.t[-1] else 0
        if 0 < self._late_in_a_row <= LATE_IN_A_ROW or abs(t) >= MAX_STAMP:
            return
        if self._late_in_a_row:  # the clock was set back
            self.t.clear()
            self.rows.clear()
        self.rows.append(self._row(t, *values))
        self.t.append(t)
        if len(self.t) > 2 * MAX_SAMPLES:
            del self.t[:MAX_SAMPLES], self.rows[:MAX_SAMPLES]

    def holds_up(self, t: float) -> bool:
        """Whether samples are coming, but none at or after a stamp yet."""
        alive = time.monotonic() - self.received < MAX_SILENCE
        return alive and not (self.t and self.t[-1] >= t)

    def at(self, t: float) -> list[float] | None:
        """The row at a stamp, linear between samples; None where it was not measured."""
        after = bisect_left(self.t, t)
        if after == len(self.t) or t < self.t[0]:
            return None
        span = slice(max(after - 1, 0), max(after, 1) + 1)
        stamps, columns = self.t[span], zip(*self.rows[span], strict=True)
        if stamps[-1] - stamps[0] > self._max_gap:
            return None
        return [float(np.interp(t, stamps, column)) for column in columns]

    def _row(self, t: float, *values: float) -> tuple[float, ...]:
        """What is kept of a sample."""
        return values


class PoseSeries(Series):
    """Poses over time; the heading is unwrapped."""

    _theta = _turned = 0.0

    def _row(self, t: float, *values: float) -> tuple[float, ...]:
        x, y, theta = values
        self._turned = self._turned + _full_turns(theta - self._theta) if self.t else 0.0
        self._theta = theta
        return x, y, theta + self._turned

    def pose_at(self, t: float) -> Pose2 | None:
        """The pose at a stamp."""
        row = self.at(t)
        return None if row is None else Pose2(row[0], row[1], wrap_angle(row[2]))


class IntegralSeries(Series):
    """The integral of a rate from its first sample on."""

    _rate = _total = 0.0

    def _row(self, t: float, *values: float) -> tuple[float, ...]:
        (rate,) = values
        self._total += (t - self.t[-1]) * 0.5 * (rate + self._rate) if self.t else -self._total
        self._rate = rate
        return (self._total,)


def _full_turns(step: float) -> float:
    """The full turns that unwrapping adds for a step of the heading, as numpy does it."""
    if abs(step) < math.pi:
        return 0.0
    short = (step + math.pi) % (2.0 * math.pi) - math.pi
    if short == -math.pi and step > 0.0:
        short = math.pi
    return short - step
