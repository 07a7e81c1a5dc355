"""Keyframes: which scans enter the map."""

from __future__ import annotations

import math

from slams.params import MAX_LASERS
from slams.types import IDENTITY, Pose2

NOTHING = 0, IDENTITY, 0.0  # keyframes, pose and quality of the last
LESS = 0.85  # of the last keyframe's quality: the map lacks what is in view now


class Keyframes:
    """Trigger by distance, rotation and quality since the last scan that entered the map.

    Args:
        distance: [m].
        rotation: [rad].
        first: so many scans at the start are all keyframes: the noise of the first would stay.

    Of several lasers, distinguished by their mounts, each has keyframes of its own.
    """

    def __init__(self, distance: float, rotation: float, first: int) -> None:
        self.count = 0
        self._distance, self._rotation, self._first = distance, rotation, first
        self._last: dict[Pose2, tuple[int, Pose2, float]] = {}
        self._mount = IDENTITY

    @property
    def settling(self) -> bool:
        """Whether the map is still of the first scans."""
        return self.count <= self._first

    def due(self, pose: Pose2, quality: float, mount: Pose2) -> bool:
        """Whether a scan at `pose`, of which the share `quality` fits the map, is a keyframe.

        `mount` is that of its laser.
        """
        self._mount = mount
        count, last, usual = self._last.get(mount, NOTHING)
        if count < self._first or quality < LESS * usual:
            return True
        step = last.between(pose)
        far = math.hypot(step.x, step.y) > self._distance
        return far or abs(step.theta) > self._rotation

    def add(self, pose: Pose2, quality: float) -> None:
        """A scan at `pose` has entered the map."""
        self.count += 1
        if len(self._last) == MAX_LASERS and self._mount not in self._last:
            self._last.clear()
        count, _, _ = self._last.get(self._mount, NOTHING)
        self._last[self._mount] = count + 1, pose, quality
