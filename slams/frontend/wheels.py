"""Steps that wheels measured, where their odometry comes at a rate of its own or is reset."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.types import IDENTITY, Pose2

INTERVAL_MEMORY = 10.0  # changes of the odometry over which its usual interval is a mean
SLOWEST = 0.5  # s: odometry that does not change for longer is of a robot at rest
BETWEEN = 0.9  # of the usual interval: odometry that has not changed is that of the last message
FASTEST = 5.0, 6.3  # m/s, rad/s: no wheels drive a robot of this kind so fast


class WheelStep(NamedTuple):
    """An increment of the odometry [m, m, rad], and the time that it is of [s]."""

    increment: Pose2
    seconds: float


def is_reset(step: Pose2, seconds: float) -> bool:
    """Whether no robot drives so far in so many seconds: the odometry begins anew, or is wrong."""
    speed, rate = FASTEST
    return math.hypot(step.x, step.y) > speed * seconds or abs(step.theta) > rate * seconds


class WheelSteps:
    """Increments of the odometry from scan to scan.

    Scans between two messages of the wheels carry the last one again: they bring no increment, and
    the next brings that of the whole time. A step too fast for any robot is a reset of the
    odometry, no motion.
    """

    def __init__(self) -> None:
        self._last: Pose2 | None = None
        self._since = self._unchanged = 0.0  # s since the last increment, since it changed
        self._changes = self._interval = 0.0  # how many, and s between them: a moving average

    def take(self, odometry: Pose2 | None, dt: float) -> WheelStep | None:
        """The increment up to a scan `dt` [s] after the one before, None if there is none."""
        last, self._last = self._last, odometry
        if last is None or odometry is None:
            self._since = self._unchanged = 0.0
            return None
        self._since += dt
        self._unchanged += dt
        since, step = self._since, last.between(odometry)
        if step != IDENTITY:
            self._learn(self._unchanged)
            self._unchanged = 0.0
        elif self._unchanged < BETWEEN * self._interval:
            return None
        self._since = 0.0
        return None if is_reset(step, since) else WheelStep(step, since)

    def _learn(self, interval: float) -> None:
        if interval < SLOWEST:
            self._changes = min(self._changes + 1.0, INTERVAL_MEMORY)
            self._interval += (interval - self._interval) / self._changes
