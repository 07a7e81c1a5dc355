"""Builds ROS 2 messages from poses, scans and maps; stamps in nanoseconds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slams.ros import messages as ros
from slams.types import Floats, Laser, OccupancyGrid, Pose2, Ranges

UNKNOWN_VARIANCE = 1e6  # m^2, rad^2; robot_localization writes the same
PLANAR_AXES = (0, 1, 5)  # x, y and yaw among the six axes of a ROS covariance
Edge = tuple[str, str, Pose2]  # parent, child, the child in the parent
ZERO_VECTOR = (0.0, 0.0, 0.0)


class Maker:
    """Builds messages of the library's classes."""

    def __init__(self) -> None:
        self.store = ros.typestore()

    def of(self, msgtype: str, *values: Any) -> Any:
        """A message from the values of its fields; a tuple is the values of a nested message."""
        kinds = [kind for _, kind in self.store.fielddefs[msgtype][1]]
        filled = [self._field_value(*one) for one in zip(kinds, values, strict=True)]
        return self.store.types[msgtype](*filled)

    def grid(self, stamp: int, grid: OccupancyGrid, frame: str) -> Any:
        """The map in percent, -1 where it is unknown."""
        ny, nx = grid.p.shape
        info = _time(stamp), grid.resolution, nx, ny, _pose(Pose2(*grid.origin, 0.0))
        header = self._header(stamp, frame)
        return self.of(ros.MAP_TYPE, header, info, percent(grid))

    def path(self, stamps: list[int], poses: Floats, frame: str) -> Any:
        """A path of all poses."""
        types = self.store.types  # `of` would be slow for thousands of poses of six messages each
        header, time = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
        point, quaternion = types["geometry_msgs/msg/Point"], types["geometry_msgs/msg/Quaternion"]
        pose, pose_stamped = types["geometry_msgs/msg/Pose"], types[ros.POSE_TYPE]
        made = [
            pose_stamped(
                header(time(*_time(stamp)), frame),
                pose(point(x, y, 0.0), quaternion(*_rotation(theta))),
            )
            for stamp, (x, y, theta) in zip(stamps, poses.tolist(), strict=True)
        ]
        return self.of(ros.PATH_TYPE, self._header(stamps[0], frame), made)

    def pose(self, stamp: int, pose: Pose2, frame: str) -> Any:
        """A pose in a frame."""
        return self.of(ros.POSE_TYPE, self._header(stamp, frame), _pose(pose))

    def pose_with_covariance(self, stamp: int, pose: Pose2, covariance: Floats, frame: str) -> Any:
        """A pose with covariance (3, 3) [m, rad]; a not finite one becomes `UNKNOWN_VARIANCE`."""
        header = self._header(stamp, frame)
        return self.of(ros.POSE_COV_TYPE, header, _with_covariance(pose, covariance))

    def odometry(self, stamp: int, pose: Pose2, frame: str, child: str) -> Any:
        """Odometry with a pose, and 0 as twist and covariance."""
        with_covariance = _with_covariance(pose, np.zeros((3, 3)))
        twist = (ZERO_VECTOR, ZERO_VECTOR), np.zeros(36)
        return self.of(ros.ODOMETRY_TYPE, self._header(stamp, frame), child, with_covariance, twist)

    def imu(self, stamp: int, yaw_rate: float, frame: str) -> Any:
        """An IMU message with a yaw rate [rad/s] only; the other values are marked as unknown."""
        header, unknown = self._header(stamp, frame), np.array([-1.0, *[0.0] * 8])
        orientation, rates = (_rotation(0.0), unknown), ((0.0, 0.0, yaw_rate), np.zeros(9))
        return self.of(ros.IMU_TYPE, header, *orientation, *rates, ZERO_VECTOR, unknown)

    def transforms(self, stamp: int, edges: Sequence[Edge]) -> Any:
        """Transforms, each the pose of a child frame in its parent."""
        items = [(self._header(stamp, parent), child, _pose(at)) for parent, child, at in edges]
        return self.of(ros.TF_TYPE, items)

    def scan(self, stamp: int, frame: str, laser: Laser, ranges: Ranges, period: float) -> Any:
        """A scan with the geometry of its laser; `period` is the time between scans [s]."""
        return self.of(
            ros.SCAN_TYPE,
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

    def status(self, stamp: int, level: int, text: str, values: Mapping[str, str]) -> Any:
        """Diagnostics with one status: level 0 OK, 1 warning, 2 error."""
        status = level, "slams", text, "", list(values.items())
        header = self._header(stamp, "")
        return self.of("diagnostic_msgs/msg/DiagnosticArray", header, [status])

    def _field_value(self, kind: Any, value: Any) -> Any:
        """The value of a field of type `kind`: lists and tuples become lists and messages."""
        if isinstance(value, list):
            return [self._field_value(kind[1][0], one) for one in value]
        return self.of(kind[1], *value) if isinstance(value, tuple) else value

    def _header(self, stamp: int, frame: str) -> tuple[Any, ...]:
        return _time(stamp), frame


def _time(stamp: int) -> tuple[int, int]:
    return divmod(stamp, 10**9)


def _pose(pose: Pose2) -> tuple[Any, ...]:
    return (pose.x, pose.y, 0.0), _rotation(pose.theta)


def _rotation(theta: float) -> tuple[float, ...]:
    return 0.0, 0.0, math.sin(0.5 * theta), math.cos(0.5 * theta)


def _with_covariance(pose: Pose2, covariance: Floats) -> tuple[Any, ...]:
    full = np.zeros((6, 6))
    planar = np.where(np.isfinite(covariance), covariance, UNKNOWN_VARIANCE * np.eye(3))
    full[np.ix_(PLANAR_AXES, PLANAR_AXES)] = planar
    return _pose(pose), full.ravel()


def percent(grid: OccupancyGrid) -> NDArray[np.int8]:
    """Cells (ny * nx,) row by row from the lowest y: 0 free to 100 occupied, -1 unknown."""
    known = np.isfinite(grid.p)
    cells = np.where(known, np.round(100.0 * np.where(known, grid.p, 0.0)), -1.0)
    return cells.astype(np.int8).ravel()
