"""Odometry and gyro as they come, looked up at a scan's stamp exactly as a recorded log's are.

The sums are those of `slams.scanlog.Track`, one by one: a run of the recording gives the poses of
the live run, bit for bit.
"""

from __future__ import annotations

import math
import time
from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from slams.live.seam import BRIDGED
from slams.live.slam import LATE_IN_A_ROW
from slams.types import Pose2, wrap_angle
from slams.validation import LATEST, can_be

KEPT = 2000  # samples: 10 s at 200 Hz
ALIVE = 1.0  # [s] of silence after which nobody waits for it


class Timeline:
    """Rows of numbers by stamp; never extrapolated.

    `heard` [s] is when, on this machine's clock, the last sample came; `late` how many were not
    newer than the one before, and left out.
    """

    def __init__(self) -> None:
        self.t: list[float] = []
        self.rows: list[tuple[float, ...]] = []
        self.heard, self.late = -math.inf, 0
        self._late_in_a_row = 0

    @property
    def alive(self) -> bool:
        """Whether samples are coming."""
        return time.monotonic() - self.heard < ALIVE

    def covers(self, t: float) -> bool:
        """Whether there is a sample at or after a stamp."""
        return bool(self.t) and self.t[-1] >= t

    def is_next(self, t: float) -> bool:
        """Whether a stamp is newer than all; those of a clock that was set back begin anew."""
        self.heard = time.monotonic()
        if not self.t or t > self.t[-1]:
            self._late_in_a_row = 0
            return abs(t) < LATEST
        self.late += 1
        self._late_in_a_row += 1
        if self._late_in_a_row > LATE_IN_A_ROW:
            self.t.clear()
            self.rows.clear()
            return True
        return False

    def append(self, t: float, row: tuple[float, ...]) -> None:
        """Keep a sample that `is_next`."""
        self.t.append(t)
        self.rows.append(row)
        if len(self.t) > 2 * KEPT:
            del self.t[:KEPT], self.rows[:KEPT]

    def at(self, t: float) -> list[float] | None:
        """The row at a stamp, linear between samples; None before the first and after the last."""
        after = bisect_right(self.t, t)
        if after == 0 or t > self.t[-1]:
            return None
        span = slice(after - 1, after + 1)
        stamps, columns = self.t[span], zip(*self.rows[span], strict=True)
        return [float(np.interp(t, stamps, column)) for column in columns]


class PoseTimeline(Timeline):
    """Poses over time; the heading is unwrapped."""

    def __init__(self) -> None:
        super().__init__()
        self._theta = self._turned = 0.0

    def push(self, t: float, pose: Pose2) -> None:
        """Take a pose; what no robot can have is left out."""
        if not can_be(*pose) or not self.is_next(t):
            return
        if self.t:
            self._turned += _full_turns(pose.theta - self._theta)
        else:
            self._turned = 0.0
        self._theta = pose.theta
        self.append(t, (pose.x, pose.y, pose.theta + self._turned))

    def pose_at(self, t: float) -> Pose2 | None:
        """The pose at a stamp."""
        row = self.at(t)
        return None if row is None else Pose2(row[0], row[1], wrap_angle(row[2]))


class RateTimeline(Timeline):
    """The integral of a rate over time.

    `kept` is what another one goes on from: stamp [s] (nan for none), rate and integral.
    """

    def __init__(self, kept: tuple[float, float, float] = (math.nan, 0.0, 0.0)) -> None:
        super().__init__()
        t, self._rate, self._total = kept
        self._resumed = not math.isnan(t)
        if self._resumed:
            self.append(t, (self._total,))

    @property
    def kept(self) -> tuple[float, float, float]:
        """Stamp of the last sample, its rate, the integral."""
        return self.t[-1] if self.t else math.nan, self._rate, self._total

    def push(self, t: float, rate: float) -> None:
        """Take a rate [rad/s]; what no robot can have is left out."""
        if self._resumed:
            self._resumed = False
            if not 0.0 < t - self.t[0] <= BRIDGED:  # another drive's gyro, or a long time after
                self.t.clear()
                self.rows.clear()
        if not can_be(rate) or not self.is_next(t):
            return
        if self.t:
            self._total += (t - self.t[-1]) * 0.5 * (rate + self._rate)
        else:
            self._total = 0.0
        self._rate = rate
        self.append(t, (self._total,))

    def integral_at(self, t: float) -> float | None:
        """The integral from the first sample to a stamp."""
        row = self.at(t)
        return None if row is None else row[0]


def all_cover(timelines: Sequence[Timeline], t: float) -> bool:
    """Whether all that are alive have a sample at or after a stamp."""
    return all(line.covers(t) or not line.alive for line in timelines)


def _full_turns(step: float) -> float:
    """What unwrapping adds for a step of the heading, as numpy does it."""
    if abs(step) < math.pi:
        return 0.0
    short = (step + math.pi) % (2.0 * math.pi) - math.pi
    if short == -math.pi and step > 0.0:
        short = math.pi
    return short - step
