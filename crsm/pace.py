"""Pace: how often a scan enters the map."""

from __future__ import annotations

import math

from slams.types import Pose2


class Pace:
    """Something is due the first `settle` times, then after `step` [m or rad] or `rest` [s]."""

    def __init__(self, step: float, rest: float, settle: int = 1) -> None:
        self._step, self._rest, self._left = step, rest, settle
        self._at: Pose2 | None = None
        self._t = 0.0

    def is_due(self, pose: Pose2, t: float) -> bool:
        """Whether it is due at the scan of time `t` [s], taken at `pose`."""
        if self._at is None or self._left > 0 or abs(t - self._t) >= self._rest:
            return True
        step = self._at.between(pose)
        return max(math.hypot(step.x, step.y), abs(step.theta)) >= self._step

    def done(self, pose: Pose2, t: float) -> None:
        """It was done at `pose`, at time `t` [s]."""
        self._at, self._t = pose, t
        self._left -= self._left > 0
