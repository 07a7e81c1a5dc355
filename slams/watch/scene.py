"""What a run has shown so far, in the map frame: for whoever draws it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from slams.types import IDENTITY, Floats, Pose2

if TYPE_CHECKING:
    from slams.types import Scan

LONGEST = 1.0  # s between two scans for a velocity to mean something


class Scene:
    """The last scan's end points, the way, and the bounds of all that was seen.

    Attributes:
        pose: the last pose.
        points: (n, 2) [m] the last scan's hits in the map frame, the motion of a sweep taken out.
        way: poses so far.
        low, high: (2,) [m] bounds of points and way, all scans.
    """

    def __init__(self) -> None:
        self.pose = IDENTITY
        self.points: Floats = np.zeros((0, 2))
        self.way: list[Pose2] = []
        self.low: Floats = np.zeros(2)
        self.high: Floats = np.zeros(2)
        self._t = 0.0

    def add(self, scan: Scan, pose: Pose2) -> None:
        """Take the next scan and its pose; one that is not finite is left to the replay to tell."""
        if not np.isfinite(pose).all():
            pose = self.pose
        self.points = pose.transform(_hits(scan, self._velocity(scan, pose)))
        self.pose, self._t = pose, scan.t
        self.way.append(pose)
        seen = np.concatenate([self.points, [[pose.x, pose.y]]])
        self.low = np.minimum(self.low, seen.min(axis=0))
        self.high = np.maximum(self.high, seen.max(axis=0))

    def _velocity(self, scan: Scan, pose: Pose2) -> Pose2:
        """Motion of the base per second since the scan before."""
        seconds = scan.t - self._t
        if not self.way or not 0.0 < seconds < LONGEST:
            return IDENTITY
        return Pose2(*(value / seconds for value in self.pose.between(pose)))


def _hits(scan: Scan, velocity: Pose2) -> Floats:
    """End points (n, 2) in the base frame at the first beam's time."""
    beams = np.flatnonzero(np.isfinite(scan.ranges))
    points = scan.laser.mount.transform(
        scan.laser.directions[beams] * np.asarray(scan.ranges[beams, None], np.float64)
    )
    after = scan.laser.time_increment * beams
    turn = velocity.theta * after
    x, y = points.T
    moved = [
        np.cos(turn) * x - np.sin(turn) * y + velocity.x * after,
        np.sin(turn) * x + np.cos(turn) * y + velocity.y * after,
    ]
    return np.stack(moved, axis=1)
