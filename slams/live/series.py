"""Time series of odometry and gyro that grow sample by sample, interpolated at a scan's stamp.

The arithmetic is that of `slams.time_series`, operation by operation: a run of the recording gives
the poses of the live run, bit for bit.
"""

from __future__ import annotations

import math
import time
from bisect import bisect_left

import numpy as np

from slams.live.estimate import MAX_CONSECUTIVE_LATE
from slams.types import Pose2, wrap_angle
from slams.validation import MAX_STAMP, is_plausible

MIN_KEPT_SAMPLES = 2000  # 10 s at 200 Hz; older ones are deleted
SAMPLE_TIMEOUT = 1.0  # s without a sample; after that no scan waits for the next sample


class Series:
    """Rows of numbers by stamp, interpolated and never extrapolated.

    `received` is when the last sample was received [s, monotonic]. A sample that is not newer than
    the previous one is left out; after `MAX_CONSECUTIVE_LATE` of them the series starts again.

    Args:
        max_gap: maximum time between two samples to interpolate between them [s].
    """

    def __init__(self, max_gap: float = math.inf) -> None:
        self.t: list[float] = []
        self.rows: list[tuple[float, ...]] = []
        self.received = -math.inf
        self._max_gap, self._n_late = max_gap, 0

    def push(self, t: float, *values: float) -> None:
        """Add a sample; impossible values are left out."""
        if not is_plausible(*values):
            return
        self.received = time.monotonic()
        self._n_late = self._n_late + 1 if self.t and t <= self.t[-1] else 0
        if 0 < self._n_late <= MAX_CONSECUTIVE_LATE or abs(t) >= MAX_STAMP:
            return
        if self._n_late:  # the clock was set back
            self.t.clear()
            self.rows.clear()
        self.rows.append(self._row(t, *values))
        self.t.append(t)
        if len(self.t) > 2 * MIN_KEPT_SAMPLES:
            del self.t[:MIN_KEPT_SAMPLES], self.rows[:MIN_KEPT_SAMPLES]

    def is_behind(self, t: float) -> bool:
        """Whether samples still arrive, but none at or after the stamp t yet."""
        is_active = time.monotonic() - self.received < SAMPLE_TIMEOUT
        return is_active and not (self.t and self.t[-1] >= t)

    def at(self, t: float) -> list[float] | None:
        """The row at a stamp, linear between samples; None outside of them or in a gap."""
        after = bisect_left(self.t, t)
        if after == len(self.t) or t < self.t[0]:
            return None
        span = slice(max(after - 1, 0), max(after, 1) + 1)
        span_stamps, columns = self.t[span], zip(*self.rows[span], strict=True)
        if span_stamps[-1] - span_stamps[0] > self._max_gap:
            return None
        return [float(np.interp(t, span_stamps, column)) for column in columns]

    def _row(self, t: float, *values: float) -> tuple[float, ...]:
        """The row that is stored for a sample."""
        return values


class PoseSeries(Series):
    """Poses over time; headings are stored unwrapped."""

    _theta = _unwrapping = 0.0

    def _row(self, t: float, *values: float) -> tuple[float, ...]:
        x, y, theta = values
        self._unwrapping = self._unwrapping + _full_turns(theta - self._theta) if self.t else 0.0
        self._theta = theta
        return x, y, theta + self._unwrapping

    def pose_at(self, t: float) -> Pose2 | None:
        """The pose at a stamp."""
        row = self.at(t)
        return None if row is None else Pose2(row[0], row[1], wrap_angle(row[2]))


class IntegralSeries(Series):
    """The integral of a rate from its first sample on, by the trapezoidal rule."""

    _rate = _total = 0.0

    def _row(self, t: float, *values: float) -> tuple[float, ...]:
        (rate,) = values
        self._total += (t - self.t[-1]) * 0.5 * (rate + self._rate) if self.t else -self._total
        self._rate = rate
        return (self._total,)


def _full_turns(step: float) -> float:
    """The full turns [rad] that unwrapping adds for a step of the heading, as numpy.unwrap."""
    if abs(step) < math.pi:
        return 0.0
    short = (step + math.pi) % (2.0 * math.pi) - math.pi
    if short == -math.pi and step > 0.0:
        short = math.pi
    return short - step
