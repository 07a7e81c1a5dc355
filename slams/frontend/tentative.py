"""Matches that one scan cannot prove, and several can."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.types import Pose2, wrap_angle

SCANS, SECONDS, WAY = 4, 0.3, 0.3  # scans, s, m or rad: so long a match has to stand
SAME_PLACE, SAME_HEADING = 0.3, 0.2  # m, rad: two matches are of one place


class Standing(NamedTuple):
    """A pose that scans keep matching at: scans, seconds and way [m] so far."""

    pose: Pose2
    scans: int
    seconds: float
    way: float


class TentativeMatch:
    """A match beyond the gate of the prior, until it has stood over several scans."""

    def __init__(self) -> None:
        self._now: Standing | None = None

    def reset(self) -> None:
        """A match inside the gate was taken."""
        self._now = None

    def stands(self, pose: Pose2, step: Pose2, dt: float, drives: bool) -> bool:
        """Whether scans agree on one place long enough; with `drives`, over some way, too.

        Args:
            pose: of the match.
            step: since the scan before [m, rad].
            dt: the same [s].
            drives: whether wheels say where the robot is: they have to be contradicted on the way.
        """
        before, self._now = self._now, Standing(pose, 1, dt, 0.0)
        if before is None:
            return False
        expected = before.pose @ step
        near = math.hypot(expected.x - pose.x, expected.y - pose.y) < SAME_PLACE
        if not near or abs(wrap_angle(expected.theta - pose.theta)) > SAME_HEADING:
            return False
        moved = before.pose.between(pose)
        way = before.way + math.hypot(moved.x, moved.y) + abs(moved.theta)
        now = self._now = Standing(pose, before.scans + 1, before.seconds + dt, way)
        if now.scans < SCANS or now.seconds < SECONDS or (drives and way < WAY):
            return False
        self._now = None
        return True
