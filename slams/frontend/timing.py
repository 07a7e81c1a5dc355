"""Time between scans whose stamps jitter.

[Muth60] J. Muth: Optimal Properties of Exponentially Weighted Forecasts. JASA 55, 1960.
"""

from __future__ import annotations

import math

from slams.params import MAX_LASERS
from slams.types import Pose2

N_AVERAGED_INTERVALS = 30.0  # scans in the statistics of the stamps
MIN_INTERVAL_RATIO = 0.5  # to the mean interval, as stamps may repeat or go back
MAX_STAMP_INTERVAL = 10.0  # s; after a longer interval the motion is unknown anyway
MIN_LASER_OFFSET = 1e-3  # s between scans of two lasers, which may come at the same moment
MAX_LASER_PERIOD = 1.0  # s of a rotation; a longer interval is one of selected scans
STAMP_GAP_DEVIATIONS = 5.0  # of the intervals; in a longer interval scans are missing


class ScanTiming:
    """Interval since the last scan [s], from stamps with jitter.

    A laser rotates steadily, and its scans are stamped late by chance. The covariance of successive
    intervals is minus the variance of this jitter, and the optimal filter of the time has a
    constant gain [Muth60]. Missing scans do not compensate each other, so their stamps are kept.
    """

    def __init__(self, smooth: bool = True) -> None:
        self.interval = 0.0  # s, moving average
        self._smooth = smooth
        self._count = 0
        self._last = math.nan  # stamp
        self._latency = 0.0  # s, of the last stamp after the filtered time
        self._last_deviation = 0.0  # s, of the last interval from the mean
        self._variance = self._covariance = 0.0  # s^2, of intervals, of successive intervals

    @property
    def time(self) -> float:
        """Filtered time of the last scan [s]."""
        return self._last - self._latency

    @property
    def jitter(self) -> float:
        """Standard deviation of the stamps [s]."""
        return math.sqrt(self._jitter_variance)

    @property
    def _jitter_variance(self) -> float:
        """Variance of the stamps [s^2]; 0 if they are not smoothed."""
        if not self._smooth or self.interval > MAX_LASER_PERIOD:
            return 0.0  # keyframes come by the motion of the robot
        return min(max(-self._covariance, 0.0), 0.5 * self._variance)

    def elapsed(self, t: float) -> float:
        """Seconds since the last scan, for a scan stamped `t`; 0 for the first."""
        stamped = t - self._last
        self._last = t
        if math.isnan(stamped):
            return 0.0
        stamped = min(max(stamped, -MAX_STAMP_INTERVAL), MAX_STAMP_INTERVAL)
        if stamped < -MAX_LASER_PERIOD:  # the clock was set back
            self._latency = 0.0
            return self.interval
        self._count += 1
        if self._count == 1:
            self.interval = max(stamped, 0.0)
            return self.interval
        share = max(1.0 / self._count, 1.0 / N_AVERAGED_INTERVALS)
        deviation = stamped - self.interval
        std = math.sqrt(self._variance)
        if std > 0.0 and deviation > max(STAMP_GAP_DEVIATIONS * std, self.interval):
            self._latency = 0.0
            return stamped  # a gap is not part of the statistics
        self._variance += share * (deviation * deviation - self._variance)
        self._covariance += share * (deviation * self._last_deviation - self._covariance)
        self._last_deviation = deviation
        self.interval = max(self.interval + share * deviation, 0.0)
        return max(self._filtered(stamped), MIN_INTERVAL_RATIO * self.interval)

    def _filtered(self, stamped: float) -> float:
        """The interval between the filtered times."""
        jitter = self._jitter_variance
        if jitter <= 0.0:
            self._latency = 0.0
            return stamped
        ratio = max(self._variance - 2.0 * jitter, 0.0) / jitter  # of process to measurement noise
        gain = 0.5 * (math.sqrt(ratio * ratio + 4.0 * ratio) - ratio)
        gain = max(gain, 1.0 / N_AVERAGED_INTERVALS)
        innovation = self._latency + stamped - self.interval
        self._latency = (1.0 - gain) * innovation
        return self.interval + gain * innovation


class LaserTimings:
    """`ScanTiming` of each of several lasers, distinguished by their mounts.

    Each laser scans at steady intervals; the intervals between two lasers are not steady.
    """

    def __init__(self, smooth: bool = True) -> None:
        self._smooth = smooth
        self._timings: dict[Pose2, ScanTiming] = {}
        self._last: ScanTiming | None = None

    @property
    def jitter(self) -> float:
        """Standard deviation of the stamps of the last scan's laser [s]."""
        return self._last.jitter if self._last else 0.0

    def elapsed(self, t: float, mount: Pose2) -> float:
        """Seconds since the last scan of any laser, for a scan stamped `t`; 0 for the first."""
        if len(self._timings) == MAX_LASERS and mount not in self._timings:
            self._timings.clear()
        before, now = self._last, self._timings.setdefault(mount, ScanTiming(self._smooth))
        elapsed, self._last = now.elapsed(t), now
        if before is None or before is now:
            return elapsed
        return min(max(now.time - before.time, MIN_LASER_OFFSET), MAX_STAMP_INTERVAL)
