"""Messages of ROS 2 made of poses, scans and maps; stamps in nanoseconds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slams.formats.ros_store import store
from slams.types import Floats, Laser, OccupancyGrid, Pose2, Ranges

UNKNOWN = 1e6  # [m^2, rad^2] a variance that says nothing, as robot_localization writes it
PLANE = (0, 1, 5)  # x, y and yaw among the six of a ROS covariance
Edge = tuple[str, str, Pose2]  # parent, child, the child in the parent


class Maker:
    """Makes messages of the library's classes."""

    def __init__(self) -> None:
        self.types = store().types

    def grid(self, stamp: int, grid: OccupancyGrid, frame: str) -> Any:
        """The map in percent, -1 where nothing was seen."""
        ny, nx = grid.p.shape
        origin = self._pose(Pose2(grid.origin[0], grid.origin[1], 0.0))
        info = self._of(
            "nav_msgs/msg/MapMetaData", self._time(stamp), grid.resolution, nx, ny, origin
        )
        return self._of(
            "nav_msgs/msg/OccupancyGrid", self._header(stamp, frame), info, percent(grid)
        )

    def path(self, stamps: list[int], poses: Floats, frame: str) -> Any:
        """All poses."""
        every = [
            self.pose(stamp, Pose2(*pose), frame)
            for stamp, pose in zip(stamps, poses.tolist(), strict=True)
        ]
        return self._of("nav_msgs/msg/Path", self._header(stamps[0], frame), every)

    def pose(self, stamp: int, pose: Pose2, frame: str) -> Any:
        """A pose in a frame."""
        header = self._header(stamp, frame)
        return self._of("geometry_msgs/msg/PoseStamped", header, self._pose(pose))

    def posed(self, stamp: int, pose: Pose2, covariance: Floats, frame: str) -> Any:
        """A pose with its covariance (3, 3) [m, rad]; what is not finite becomes `UNKNOWN`."""
        return self._of(
            "geometry_msgs/msg/PoseWithCovarianceStamped",
            self._header(stamp, frame),
            self._with_covariance(pose, covariance),
        )

    def odometry(self, stamp: int, pose: Pose2, frame: str, child: str) -> Any:
        """A pose as odometry tells it; the speed is left at 0."""
        still = self._vector(0.0, 0.0, 0.0)
        twist = self._of("geometry_msgs/msg/Twist", still, still)
        return self._of(
            "nav_msgs/msg/Odometry",
            self._header(stamp, frame),
            child,
            self._with_covariance(pose, np.zeros((3, 3))),
            self._of("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36)),
        )

    def imu(self, stamp: int, yaw_rate: float, frame: str) -> Any:
        """A gyro's reading about the upright axis [rad/s]; nothing else is known."""
        nothing = np.array([-1.0, *[0.0] * 8])
        return self._of(
            "sensor_msgs/msg/Imu",
            self._header(stamp, frame),
            self._rotation(Pose2(0.0, 0.0, 0.0)),
            nothing,
            self._vector(0.0, 0.0, yaw_rate),
            np.zeros(9),
            self._vector(0.0, 0.0, 0.0),
            nothing,
        )

    def transforms(self, stamp: int, edges: Sequence[Edge]) -> Any:
        """Frames in others."""
        return self._of("tf2_msgs/msg/TFMessage", [self._edge(stamp, *edge) for edge in edges])

    def scan(self, stamp: int, frame: str, laser: Laser, ranges: Ranges, period: float) -> Any:
        """A scan as the algorithm got it."""
        return self._of(
            "sensor_msgs/msg/LaserScan",
            self._header(stamp, frame),
            laser.angle_min,
            laser.angle_min + laser.angle_increment * (laser.n_beams - 1),
            laser.angle_increment,
            laser.time_increment,
            period,
            laser.range_min,
            laser.range_max,
            np.ascontiguousarray(ranges, np.float32),
            np.zeros(0, np.float32),
        )

    def status(
        self, stamp: int, name: str, level: int, word: str, values: Mapping[str, str]
    ) -> Any:
        """One line of diagnostics: level 0 fine, 1 doubtful, 2 wrong."""
        pairs = [self._of("diagnostic_msgs/msg/KeyValue", *pair) for pair in values.items()]
        line = self._of("diagnostic_msgs/msg/DiagnosticStatus", level, name, word, "", pairs)
        return self._of("diagnostic_msgs/msg/DiagnosticArray", self._header(stamp, ""), [line])

    def _of(self, msgtype: str, *fields: Any) -> Any:
        return self.types[msgtype](*fields)

    def _time(self, stamp: int) -> Any:
        return self._of("builtin_interfaces/msg/Time", *divmod(stamp, 10**9))

    def _header(self, stamp: int, frame: str) -> Any:
        return self._of("std_msgs/msg/Header", self._time(stamp), frame)

    def _edge(self, stamp: int, parent: str, child: str, pose: Pose2) -> Any:
        transform = self._of(
            "geometry_msgs/msg/Transform", self._vector(pose.x, pose.y, 0.0), self._rotation(pose)
        )
        header = self._header(stamp, parent)
        return self._of("geometry_msgs/msg/TransformStamped", header, child, transform)

    def _with_covariance(self, pose: Pose2, covariance: Floats) -> Any:
        whole = np.zeros((6, 6))
        known = np.where(np.isfinite(covariance), covariance, UNKNOWN * np.eye(3))
        whole[np.ix_(PLANE, PLANE)] = known
        return self._of("geometry_msgs/msg/PoseWithCovariance", self._pose(pose), whole.ravel())

    def _pose(self, pose: Pose2) -> Any:
        position = self._of("geometry_msgs/msg/Point", pose.x, pose.y, 0.0)
        return self._of("geometry_msgs/msg/Pose", position, self._rotation(pose))

    def _vector(self, x: float, y: float, z: float) -> Any:
        return self._of("geometry_msgs/msg/Vector3", x, y, z)

    def _rotation(self, pose: Pose2) -> Any:
        half = 0.5 * pose.theta
        return self._of("geometry_msgs/msg/Quaternion", 0.0, 0.0, math.sin(half), math.cos(half))


def percent(grid: OccupancyGrid) -> NDArray[np.int8]:
    """Cells row by row from the lowest y, 0 free to 100 occupied, -1 never observed."""
    known = np.isfinite(grid.p)
    cells = np.where(known, np.round(100.0 * np.where(known, grid.p, 0.0)), -1.0)
    return cells.astype(np.int8).ravel()
