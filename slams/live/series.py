"""Odometry and gyro as they come, looked up at a scan's stamp exactly as a recorded log's are.

The sums are those of `slams.scanlog.Track`, one by one: a run of the recording gives the poses of
the live run, bit for bit.
"""

from __future__ import annotations

import math
import time
from bisect import bisect_left, bisect_right
from collections.abc import Sequence

import numpy as np

from slams.live.slam import LATE_IN_A_ROW
from slams.track import MAX_ATTITUDE_GAP
from slams.types import Attitude, Pose2, wrap_angle
from slams.validation import LATEST, can_be

MAX_SAMPLES = 2000  # at least as many are kept: 10 s at 200 Hz
MAX_SILENCE = 1.0  # [s] after the last sample; then no scan waits for the next


class Series:
    """Rows of numbers by stamp, interpolated and never extrapolated.

    `received` [s] is when, on this machine's clock, the last sample came; `late` how many were not
    newer than the one before, and left out.
    """

    def __init__(self) -> None:
        self.t: list[float] = []
        self.rows: list[tuple[float, ...]] = []
        self.received, self.late = -math.inf, 0
        self._late_in_a_row = 0

    @property
    def is_alive(self) -> bool:
        """Whether samples are coming."""
        return time.monotonic() - self.received < MAX_SILENCE

    def covers(self, t: float) -> bool:
        """Whether there is a sample at or after a stamp."""
        return bool(self.t) and self.t[-1] >= t

    def accepts(self, t: float) -> bool:
        """Whether a stamp is newer than all; after a clock was set back the series begins anew."""
        self.received = time.monotonic()
        if not self.t or t > self.t[-1]:
            self._late_in_a_row = 0
            return abs(t) < LATEST
        self.late += 1
        self._late_in_a_row += 1
        if self._late_in_a_row <= LATE_IN_A_ROW:
            return False
        self.t.clear()
        self.rows.clear()
        return True

    def append(self, t: float, row: tuple[float, ...]) -> None:
        """Keep a sample that is accepted."""
        self.t.append(t)
        self.rows.append(row)
        if len(self.t) > 2 * MAX_SAMPLES:
            del self.t[:MAX_SAMPLES], self.rows[:MAX_SAMPLES]

    def at(self, t: float) -> list[float] | None:
        """The row at a stamp, linear between samples; None before the first and after the last."""
        after = bisect_right(self.t, t)
        if after == 0 or t > self.t[-1]:
            return None
        span = slice(after - 1, after + 1)
        stamps, columns = self.t[span], zip(*self.rows[span], strict=True)
        return [float(np.interp(t, stamps, column)) for column in columns]


class PoseSeries(Series):
    """Poses over time; the heading is unwrapped."""

    def __init__(self) -> None:
        super().__init__()
        self._theta = self._turned = 0.0

    def push(self, t: float, pose: Pose2) -> None:
        """Take a pose; one that no robot can have is left out."""
        if not can_be(*pose) or not self.accepts(t):
            return
        self._turned = self._turned + _full_turns(pose.theta - self._theta) if self.t else 0.0
        self._theta = pose.theta
        self.append(t, (pose.x, pose.y, pose.theta + self._turned))

    def pose_at(self, t: float) -> Pose2 | None:
        """The pose at a stamp."""
        row = self.at(t)
        return None if row is None else Pose2(row[0], row[1], wrap_angle(row[2]))


class RateSeries(Series):
    """The integral of a rate over time."""

    def __init__(self) -> None:
        super().__init__()
        self._rate = self._total = 0.0

    def push(self, t: float, rate: float) -> None:
        """Take a rate [rad/s]; one that no robot can have is left out."""
        if not can_be(rate) or not self.accepts(t):
            return
        self._total += (t - self.t[-1]) * 0.5 * (rate + self._rate) if self.t else -self._total
        self._rate = rate
        self.append(t, (self._total,))

    def integral_at(self, t: float) -> float | None:
        """The integral from the first sample to a stamp."""
        row = self.at(t)
        return None if row is None else row[0]


class AttitudeSeries(Series):
    """Roll and pitch over time."""

    def push(self, t: float, roll: float, pitch: float) -> None:
        """Take an attitude [rad]; what is not finite is left out."""
        if can_be(roll, pitch) and self.accepts(t):
            self.append(t, (roll, pitch))

    def attitude_at(self, t: float) -> Attitude | None:
        """The attitude at a stamp; None where it was not measured, and in gaps."""
        row = self.at(t)
        after = min(max(bisect_left(self.t, t), 1), len(self.t) - 1)
        if row is None or (after > 0 and self.t[after] - self.t[after - 1] > MAX_ATTITUDE_GAP):
            return None
        return Attitude(*row)


def all_cover(series: Sequence[Series], t: float) -> bool:
    """Whether all that are alive have a sample at or after a stamp."""
    return all(one.covers(t) or not one.is_alive for one in series)


def _full_turns(step: float) -> float:
    """The full turns that unwrapping adds for a step of the heading, as numpy does it."""
    if abs(step) < math.pi:
        return 0.0
    short = (step + math.pi) % (2.0 * math.pi) - math.pi
    if short == -math.pi and step > 0.0:
        short = math.pi
    return short - step
