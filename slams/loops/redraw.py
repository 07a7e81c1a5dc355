"""Redraw: the map drawn anew from keyframes whose poses have changed, a few for each scan."""

from __future__ import annotations

import math

from slams.localize.hooks import Localizes
from slams.loops.graph import LEVER, PoseGraph
from slams.loops.matching import Keyframe
from slams.types import Pose2, wrap_angle

MOVED = 0.05  # m, and as many times 0.1 rad, that a keyframe has to move, or the map stays


def gap(one: Pose2, other: Pose2) -> float:
    """Distance of two poses [m], as walls `LEVER` away show it."""
    turn = abs(wrap_angle(one.theta - other.theta))
    return math.hypot(one.x - other.x, one.y - other.y) + LEVER * turn


class Redraw:
    """A new instance of an algorithm into which keyframes enter, a few for each scan.

    `done` once it has all that the graph has.
    """

    def __init__(self, slam: Localizes, keyframes: list[Keyframe]) -> None:
        self.slam = slam
        self._keyframes = keyframes
        self._poses: list[Pose2] = []  # at which keyframes are in the map

    @property
    def done(self) -> bool:
        """Whether every keyframe is in the map."""
        return len(self._poses) == len(self._keyframes)

    def is_outdated(self, graph: PoseGraph) -> bool:
        """Whether keyframes that are in the map have moved."""
        last = len(self._poses) - 1
        return last >= 0 and gap(self._poses[last], graph.pose(last)) > MOVED

    def insert(self, count: int, graph: PoseGraph) -> None:
        """Let the next `count` keyframes enter."""
        first = len(self._poses)
        for k in range(first, min(first + count, len(self._keyframes))):
            self._poses.append(graph.pose(k))
            self.slam.insert_at(self._keyframes[k].scan, self._poses[k])
