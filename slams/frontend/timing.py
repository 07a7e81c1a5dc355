"""Time between scans, where recorders stamp scans when they get round to it."""

from __future__ import annotations

import math

from slams.params import MAX_LASERS
from slams.types import Pose2

MEMORY = 30.0  # intervals over which the statistics of the stamps are a mean
SHORTEST = 0.5  # of the usual interval: no interval is shorter, stamps may repeat or go back
LONGEST = 10.0  # s; after a longer interval nothing more is unknown
SHORTEST_STEP = 1e-3  # s: two lasers may scan at the same moment
SLOWEST = 1.0  # s: no laser takes longer for a turn; these scans were chosen, as keyframes are
GAP = 5.0  # deviations of the intervals beyond which scans are missing


class ScanTiming:
    """Interval since the scan before [s], from stamps that may be late by chance.

    A laser that turns steadily and a recorder that stamps late make intervals that compensate each
    other: their covariance from one to the next is minus the variance of the jitter (an MA(1)
    process [Muth60]). The time of a scan is then a level that is filtered with the gain of that
    model; scans that are missing make intervals that do not compensate, and stamps are believed.
    """

    def __init__(self, smooth: bool = True) -> None:
        self.interval = 0.0  # s, moving average
        self._smooth = smooth
        self._count = 0
        self._last = math.nan  # stamp
        self._late = 0.0  # s, the last stamp less the filtered time
        self._before = 0.0  # s, deviation of the interval before
        self._variance = self._covariance = 0.0

    @property
    def time(self) -> float:
        """Filtered time of the last scan [s]."""
        return self._last - self._late

    @property
    def jitter(self) -> float:
        """Deviation of the stamps [s]."""
        return math.sqrt(self._jitter) if self._smooth else 0.0

    @property
    def _jitter(self) -> float:
        """Variance of the stamps [s^2]; keyframes come as the robot drives."""
        if self.interval > SLOWEST:
            return 0.0
        return min(max(-self._covariance, 0.0), 0.5 * self._variance)

    def elapsed(self, t: float) -> float:
        """Seconds since the scan before, for a scan stamped `t`; 0 for the first."""
        stamped = t - self._last
        self._last = t
        if math.isnan(stamped):
            return 0.0
        stamped = min(max(stamped, -LONGEST), LONGEST)
        self._count += 1
        share = max(1.0 / self._count, 1.0 / MEMORY)
        off = stamped - self.interval
        deviation = math.sqrt(self._variance)
        if self._count > 1 and deviation > 0.0 and off > GAP * deviation and off > self.interval:
            self._late = 0.0  # a gap; it is not part of the statistics
            return stamped
        self._variance += share * (off * off - self._variance)
        self._covariance += share * (off * self._before - self._covariance)
        self._before = off
        self.interval = max(self.interval + share * off, 0.0)
        return max(self._filtered(stamped), SHORTEST * self.interval)

    def _filtered(self, stamped: float) -> float:
        """The interval between the filtered times."""
        jitter = self._jitter
        if not self._smooth or jitter <= 0.0:
            self._late = 0.0
            return stamped
        noise = max(self._variance - 2.0 * jitter, 0.0) / jitter  # of the true interval, in jitter
        gain = 0.5 * (math.sqrt(noise * noise + 4.0 * noise) - noise)  # steady state [Muth60]
        gain = max(gain, 1.0 / MEMORY)
        ahead = self._late + stamped - self.interval  # of the stamp before the predicted time
        self._late = (1.0 - gain) * ahead
        return self.interval + gain * ahead


class LaserTimings:
    """`ScanTiming` of several lasers, distinguished by mount, whose scans come in turns.

    Each turns steadily by itself; together they do not.
    """

    def __init__(self, smooth: bool = True) -> None:
        self._smooth = smooth
        self._timings: dict[Pose2, ScanTiming] = {}
        self._last: ScanTiming | None = None

    @property
    def jitter(self) -> float:
        """Deviation of the stamps of the last scan's laser [s]."""
        return self._last.jitter if self._last else 0.0

    def elapsed(self, t: float, mount: Pose2) -> float:
        """Seconds since the scan before, of any laser, for a scan stamped `t`; 0 for the first."""
        before, self._last = self._last, self._timings.get(mount)
        if self._last is None:
            if len(self._timings) == MAX_LASERS:
                self._timings.clear()
            self._last = self._timings[mount] = ScanTiming(self._smooth)
        time = before.time if before else math.nan
        elapsed = self._last.elapsed(t)
        if before is None or before is self._last:
            return elapsed
        return min(max(self._last.time - time, SHORTEST_STEP), LONGEST)
