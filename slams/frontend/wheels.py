"""Increments of wheel odometry, which may come at its own rate or be reset."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.frontend.timing import MIN_LASER_OFFSET
from slams.types import IDENTITY, Pose2

N_AVERAGED_WHEEL_INTERVALS = 10.0  # changes of the odometry in the mean interval
MAX_WHEEL_INTERVAL = 0.5  # s; a robot whose odometry does not change for longer is at rest
MIN_CHANGE_RATIO = 0.9  # of the mean interval; earlier the odometry repeats the last message
MAX_WHEEL_SPEED, MAX_WHEEL_TURN_RATE = 5.0, 6.3  # m/s, rad/s, of robots of this kind


class WheelStep(NamedTuple):
    """An increment of the odometry [m, m, rad], its time [s], and the change of its rate.

    The change is from the last increment to this one [m/s, m/s, rad/s].
    """

    increment: Pose2
    seconds: float
    rate_change: Pose2


def is_reset(step: Pose2, seconds: float) -> bool:
    """Whether a step is too large for its time: the odometry was reset, or is wrong."""
    if math.hypot(step.x, step.y) > MAX_WHEEL_SPEED * seconds:
        return True
    return abs(step.theta) > MAX_WHEEL_TURN_RATE * seconds


class WheelSteps:
    """Increments of the odometry from scan to scan.

    Scans between two messages of the wheels repeat the last odometry. They have no increment, and
    the next scan has that of the whole time. A reset gives no increment.
    """

    def __init__(self) -> None:
        self._last: Pose2 | None = None
        self._rate: tuple[float, ...] | None = None  # of the last increment
        self._since = self._unchanged = 0.0  # s since the last increment, since the last change
        self._changes = self._interval = 0.0  # number of changes, mean interval between them [s]

    def take(self, odometry: Pose2 | None, dt: float) -> WheelStep | None:
        """The increment up to a scan `dt` [s] after the last scan, or None."""
        last, self._last = self._last, odometry
        if last is None or odometry is None:
            self._since = self._unchanged = 0.0
            self._rate = None
            return None
        self._since += dt
        self._unchanged += dt
        since, step = self._since, last.between(odometry)
        if step != IDENTITY:
            if self._unchanged < MAX_WHEEL_INTERVAL:
                self._changes = min(self._changes + 1.0, N_AVERAGED_WHEEL_INTERVALS)
                self._interval += (self._unchanged - self._interval) / self._changes
            self._unchanged = 0.0
        elif self._unchanged < MIN_CHANGE_RATIO * self._interval:
            return None
        self._since = 0.0
        rate = tuple(value / max(since, MIN_LASER_OFFSET) for value in step)
        last_rate, self._rate = self._rate or rate, rate
        if is_reset(step, since):
            return None
        change = (after - before for before, after in zip(last_rate, rate, strict=True))
        return WheelStep(step, since, Pose2(*change))
