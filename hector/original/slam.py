"""The published program of Hector SLAM, hector_mapping 0.5.2.

[Kohlbrecher11] S. Kohlbrecher, O. von Stryk, J. Meyer, U. Klingauf: A Flexible and Scalable SLAM
System with Full 3D Motion Estimation. IEEE SSRR 2011. Per scan:

1. End points of the beams in the base frame (sec. IV-A).
2. Scan matching (sec. IV-B) from the last pose: Gauss-Newton, coarse to fine (sec. IV-C). The
   result is the pose, without a check.
3. If the robot has moved, insert the scan into every level (sec. IV-A).
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

from hector.original.map import Pyramid
from hector.original.motion import Motion
from hector.original.params import OriginalParams
from hector.original.scan import EndPoints
from slams.params import Params
from slams.types import IDENTITY, OccupancyGrid, Pose2, Scan


class Original:
    """hector_mapping; see the module for the steps."""

    Params: ClassVar[type[Params]] = OriginalParams

    def __init__(self, params: OriginalParams) -> None:
        self.params = params
        self._map = Pyramid(params)
        self._motion = Motion(params.start)
        self._points: EndPoints | None = None
        self._pose = self._inserted_at = IDENTITY
        self._counts = {"empty": 0, "inserted": 0}

    def update(self, scan: Scan) -> Pose2:
        """Match the scan to the map, insert it if due; return T_map_base."""
        points = self._points_of(scan)
        pose = self._motion.predict(self._pose, scan)  # the last pose by default
        points.read(scan, self._motion.velocity)  # 1.
        self._counts["empty"] += points.n == 0
        pose = self._match(points, pose)  # 2.
        if points.has_sweep:
            points.read(scan, self._motion.velocity_to(pose))
            pose = self._match(points, pose)
        self._pose = pose
        self._motion.correct(pose, scan)
        if points.n > 0 and self._due():  # 3.
            self._map.insert(points, pose)
            self._counts["inserted"] += 1
            self._inserted_at = pose
        return pose

    def map(self) -> OccupancyGrid:
        """The finest level as probabilities."""
        return self._map.occupancy()

    def report(self) -> dict[str, Any]:
        """Numbers of scans: empty, inserted, predicted by odometry and by gyro."""
        return self._counts | {"odometry": self._motion.odometry, "gyro": self._motion.gyro}

    def _points_of(self, scan: Scan) -> EndPoints:
        """Buffers for the scan's laser."""
        if self._points is None or self._points.laser != scan.laser:
            self._points = EndPoints(self.params, scan.laser)
        return self._points

    def _match(self, points: EndPoints, start: Pose2) -> Pose2:
        if self._map.insertions == 0 or points.n == 0:
            return start
        return self._map.match(points, start)

    def _due(self) -> bool:
        """Whether the robot has moved enough since the last insertion, or nothing is inserted."""
        step = self._inserted_at.between(self._pose)
        moved = math.hypot(step.x, step.y) > self.params.insert_distance
        turned = abs(step.theta) > self.params.insert_angle
        return self._map.insertions == 0 or moved or turned
