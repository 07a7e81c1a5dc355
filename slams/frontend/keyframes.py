"""Keyframes: which scans enter the map."""

from __future__ import annotations

import math

from slams.types import IDENTITY, Pose2

LESS = 0.85  # of the last keyframe's quality: the map lacks what is in view now


class Keyframes:
    """Trigger by distance, rotation and quality since the last scan that entered the map.

    Args:
        distance: [m].
        rotation: [rad].
        first: so many scans at the start are all keyframes: the noise of the first would stay.
    """

    def __init__(self, distance: float, rotation: float, first: int) -> None:
        self.count = 0
        self._distance, self._rotation, self._first = distance, rotation, first
        self._pose, self._quality = IDENTITY, 0.0

    def due(self, pose: Pose2, quality: float) -> bool:
        """Whether a scan at `pose`, of which the share `quality` fits the map, is a keyframe."""
        if self.count < self._first or quality < LESS * self._quality:
            return True
        step = self._pose.between(pose)
        far = math.hypot(step.x, step.y) > self._distance
        return far or abs(step.theta) > self._rotation

    def add(self, pose: Pose2, quality: float) -> None:
        """A scan at `pose` has entered the map."""
        self.count += 1
        self._pose, self._quality = pose, quality
