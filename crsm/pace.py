"""Pace: how often a scan enters the map."""

from __future__ import annotations

import math

from slams.types import Pose2


class Pace:
    """Something is due at once, then again after `step` [m or rad] or after `rest` scans."""

    def __init__(self, step: float, rest: int) -> None:
        self._step, self._rest = step, rest
        self._at: Pose2 | None = None
        self._scans = 0

    def is_due(self, pose: Pose2) -> bool:
        """Whether it is due at this scan, taken at `pose`."""
        self._scans += 1
        if self._at is None or self._scans >= self._rest:
            return True
        step = self._at.between(pose)
        return max(math.hypot(step.x, step.y), abs(step.theta)) >= self._step

    def done(self, pose: Pose2) -> None:
        """It was done at `pose`."""
        self._at, self._scans = pose, 0
