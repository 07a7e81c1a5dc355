"""The standard ROS message types: names and definitions, and readers of their content."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from slams.types import Laser, Ranges

SCAN_TYPE = "sensor_msgs/msg/LaserScan"
MULTI_ECHO_TYPE = "sensor_msgs/msg/MultiEchoLaserScan"
IMU_TYPE = "sensor_msgs/msg/Imu"
ODOMETRY_TYPE = "nav_msgs/msg/Odometry"
POSE_TYPE = "geometry_msgs/msg/PoseStamped"
POSE_COV_TYPE = "geometry_msgs/msg/PoseWithCovarianceStamped"
PATH_TYPE = "nav_msgs/msg/Path"
MAP_TYPE = "nav_msgs/msg/OccupancyGrid"
TF_TYPE, OLD_TF_TYPE = "tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"
SCAN_TYPES, TF_TYPES = (SCAN_TYPE, MULTI_ECHO_TYPE), (TF_TYPE, OLD_TF_TYPE)
TRUTH_TYPES = (ODOMETRY_TYPE, POSE_TYPE, POSE_COV_TYPE)
POSE_TYPES = (*TRUTH_TYPES, PATH_TYPE)
READABLE_TYPES = frozenset({*SCAN_TYPES, *POSE_TYPES, *TF_TYPES, IMU_TYPE})


class ImuReading(NamedTuple):
    """Stamp [s], quaternion x, y, z, w, rates, acceleration in the IMU's axes; nan: unknown."""

    stamp: float
    orientation: tuple[float, float, float, float]
    rates: tuple[float, float, float]
    acceleration: tuple[float, float, float]


class Record(NamedTuple):
    """One message as stored in a bag; `received` is the recorder's time [ns]."""

    topic: str
    msgtype: str
    received: int
    data: bytes


@cache
def typestore() -> Any:
    """Definitions, classes and CDR of ROS 2's standard messages, the same in all releases."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


@cache
def decoder(ros1: bool) -> Callable[[bytes, str], Any]:
    """The function that decodes raw messages of `READABLE_TYPES`.

    It uses the standard definitions instead of the bag's: an old recording has none, and a broken
    definition of another type must not prevent reading the scans.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types: Any = get_typestore(Stores.ROS1_NOETIC) if ros1 else typestore()
    for name in TF_TYPES if ros1 else ():
        types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
    decode: Callable[[bytes, str], Any] = types.deserialize_ros1 if ros1 else types.deserialize_cdr
    return decode


def _scan_of(message: Any) -> tuple[str, tuple[Ranges, Laser]]:
    """Frame, ranges and geometry of a scan; of several echoes the first, of none infinity."""
    from slams.laser_table import as_float32
    from slams.types import Laser

    readings = message.ranges
    if getattr(message, "__msgtype__", SCAN_TYPE) == MULTI_ECHO_TYPE:
        readings = [beam.echoes[0] if len(beam.echoes) else math.inf for beam in readings]
    ranges = as_float32(readings).copy()
    geometry = Laser(
        float(message.angle_min),
        float(message.angle_increment),
        ranges.size,
        float(message.range_min),
        float(message.range_max),
        time_increment=float(message.time_increment),
    )
    return getattr(message.header, "frame_id", ""), (ranges, geometry)


def imu_reading(message: Any) -> ImuReading:
    """The reading in a sensor_msgs/Imu; a covariance of -1 marks a value that is not measured.

    An orientation of zeros or the identity is not measured either: it is a driver's placeholder,
    and a measured one has noise.
    """
    q, w, a = message.orientation, message.angular_velocity, message.linear_acceleration
    has_orientation = message.orientation_covariance[0] != -1.0 and (q.x or q.y or q.z)
    has_rates = message.angular_velocity_covariance[0] != -1.0
    return ImuReading(
        seconds(message.header.stamp),
        (q.x, q.y, q.z, q.w) if has_orientation else (math.nan,) * 4,
        (w.x, w.y, w.z) if has_rates else (math.nan,) * 3,
        (a.x, a.y, a.z),
    )


def planar_pose(pose: Any) -> list[float]:
    """Planar x, y [m], heading [rad] of a pose message."""
    return [pose.position.x, pose.position.y, yaw_of(pose.orientation)]


def yaw_of(q: Any) -> float:
    """Heading [rad] of a quaternion message."""
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), q.w * q.w + q.x * q.x - q.y * q.y - q.z * q.z)


def seconds(stamp: Any) -> float:
    """A ROS stamp, of ROS 2 (sec, nanosec) or ROS 1 (secs, nsecs), or a number [s]."""
    if hasattr(stamp, "nanosec"):
        return float(stamp.sec + 1e-9 * stamp.nanosec)
    if hasattr(stamp, "nsecs"):
        return float(stamp.secs + 1e-9 * stamp.nsecs)
    return float(stamp)


READERS: dict[str, Callable[[Any], tuple[str, Any]]] = {
    SCAN_TYPE: _scan_of,
    MULTI_ECHO_TYPE: _scan_of,
    ODOMETRY_TYPE: lambda message: (message.child_frame_id, planar_pose(message.pose.pose)),
    IMU_TYPE: lambda message: (message.header.frame_id, imu_reading(message)),
    POSE_TYPE: lambda message: ("", planar_pose(message.pose)),
    POSE_COV_TYPE: lambda message: ("", planar_pose(message.pose.pose)),
}
