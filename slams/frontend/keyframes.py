"""Keyframes: which scans enter the map."""

from __future__ import annotations

import math

from slams.params import MAX_LASERS
from slams.types import IDENTITY, Pose2

NO_KEYFRAME = 0, IDENTITY, 0.0  # number of keyframes, pose and quality of the last
MIN_QUALITY_RATIO = 0.85  # to the last keyframe; below it the map lacks much of what is in view


class Keyframes:
    """Keyframe trigger by distance, rotation and quality since the last keyframe.

    Args:
        distance: [m].
        rotation: [rad].
        first: number of scans at the start that are all keyframes, to average their noise.

    Each of several lasers, distinguished by their mounts, has keyframes of its own.
    """

    def __init__(self, distance: float, rotation: float, first: int) -> None:
        self.count = 0
        self._distance, self._rotation, self._first = distance, rotation, first
        self._last: dict[Pose2, tuple[int, Pose2, float]] = {}
        self._mount = IDENTITY

    @property
    def settling(self) -> bool:
        """Whether the map consists of the first scans only."""
        return self.count <= self._first

    def due(self, pose: Pose2, quality: float, mount: Pose2) -> bool:
        """Whether a scan at `pose` is a keyframe.

        `quality` is the share of its beams that fit the map, `mount` that of its laser.
        """
        self._mount = mount
        count, last, last_quality = self._last.get(mount, NO_KEYFRAME)
        if count < self._first or quality < MIN_QUALITY_RATIO * last_quality:
            return True
        step = last.between(pose)
        far = math.hypot(step.x, step.y) > self._distance
        return far or abs(step.theta) > self._rotation

    def add(self, pose: Pose2, quality: float) -> None:
        """Record that the scan at `pose` has entered the map."""
        self.count += 1
        if len(self._last) == MAX_LASERS and self._mount not in self._last:
            self._last.clear()
        count, _, _ = self._last.get(self._mount, NO_KEYFRAME)
        self._last[self._mount] = count + 1, pose, quality
