"""What a run has shown so far, in the map frame, to draw it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from slams.types import IDENTITY, Floats, Pose2

if TYPE_CHECKING:
    from slams.types import Scan


class Scene:
    """The last scan's end points, the way, and the bounds of all that was seen.

    Attributes:
        pose: the last pose.
        points: (n, 2) [m] the last scan's hits in the map frame, not deskewed.
        way: poses so far.
        low, high: (2,) [m] bounds of points and way, all scans.
    """

    def __init__(self) -> None:
        self.pose = IDENTITY
        self.points: Floats = np.zeros((0, 2))
        self.way: list[Pose2] = []
        self.low: Floats = np.zeros(2)
        self.high: Floats = np.zeros(2)

    def add(self, scan: Scan, pose: Pose2) -> None:
        """Take the next scan and its pose; one that is not finite is left to the replay to tell."""
        if not np.isfinite(pose).all():
            pose = self.pose
        self.points = pose.transform(_hits(scan))
        self.pose = pose
        self.way.append(pose)
        seen = np.concatenate([self.points, [[pose.x, pose.y]]])
        self.low = np.minimum(self.low, seen.min(axis=0))
        self.high = np.maximum(self.high, seen.max(axis=0))


def _hits(scan: Scan) -> Floats:
    """End points (n, 2) in the base frame."""
    beams = np.flatnonzero(np.isfinite(scan.ranges))
    return scan.laser.mount.transform(
        scan.laser.directions[beams] * np.asarray(scan.ranges[beams, None], np.float64)
    )
