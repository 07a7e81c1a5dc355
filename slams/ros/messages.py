"""Messages of the standard ROS types: their names and definitions, and what each says."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from slams.types import Laser, Ranges

SCAN = "sensor_msgs/msg/LaserScan"
ECHOES = "sensor_msgs/msg/MultiEchoLaserScan"
IMU = "sensor_msgs/msg/Imu"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
POSE_COV = "geometry_msgs/msg/PoseWithCovarianceStamped"
PATH = "nav_msgs/msg/Path"
MAP = "nav_msgs/msg/OccupancyGrid"
TF, OLD_TF = "tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"
SCANS, TRUTHS, TFS = (SCAN, ECHOES), (ODOMETRY, POSE, POSE_COV), (TF, OLD_TF)
POSES = (*TRUTHS, PATH)
KNOWN = frozenset({*SCANS, *POSES, *TFS, IMU})


class Inertial(NamedTuple):
    """One message in the IMU's own axes: orientation x, y, z, w, rates, acceleration; nan: none."""

    sent: float
    orientation: tuple[float, float, float, float]
    rates: tuple[float, float, float]
    acceleration: tuple[float, float, float]


class Record(NamedTuple):
    """One message as stored; `received` [ns] is when the recorder got it."""

    topic: str
    msgtype: str
    received: int
    data: bytes


@cache
def store() -> Any:
    """Definitions, classes and CDR of the ROS 2 messages; the standard ones never changed."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


@cache
def decoder(ros1: bool) -> Callable[[bytes, str], Any]:
    """What turns raw messages of the known types into objects.

    The standard definitions are used, not those of the bag: an old recording has none, and one
    odd definition among them is no reason to refuse the scans.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types: Any = get_typestore(Stores.ROS1_NOETIC) if ros1 else store()
    for name in TFS if ros1 else ():
        types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
    decode: Callable[[bytes, str], Any] = types.deserialize_ros1 if ros1 else types.deserialize_cdr
    return decode


def _sweep(message: Any) -> tuple[str, tuple[Ranges, Laser]]:
    """Of several echoes the first of each beam; none means nothing up to range_max."""
    from slams.laser_table import as_float32
    from slams.types import Laser

    found = message.ranges
    if getattr(message, "__msgtype__", SCAN) == ECHOES:
        found = [beam.echoes[0] if len(beam.echoes) else math.inf for beam in found]
    ranges = as_float32(found).copy()
    geometry = Laser(
        float(message.angle_min),
        float(message.angle_increment),
        ranges.size,
        float(message.range_min),
        float(message.range_max),
        time_increment=float(message.time_increment),
    )
    return getattr(message.header, "frame_id", ""), (ranges, geometry)


def inertial(message: Any) -> Inertial:
    """Of a sensor_msgs/Imu; a covariance of -1 says that there is none.

    So does an orientation of zeros or the identity: drivers without one leave it at that, and what
    is measured has noise.
    """
    q, w, a = message.orientation, message.angular_velocity, message.linear_acceleration
    oriented = message.orientation_covariance[0] != -1.0 and (q.x or q.y or q.z)
    turning = message.angular_velocity_covariance[0] != -1.0
    return Inertial(
        seconds(message.header.stamp),
        (q.x, q.y, q.z, q.w) if oriented else (math.nan,) * 4,
        (w.x, w.y, w.z) if turning else (math.nan,) * 3,
        (a.x, a.y, a.z),
    )


def pose_of(pose: Any) -> list[float]:
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


READ: dict[str, Callable[[Any], tuple[str, Any]]] = {
    SCAN: _sweep,
    ECHOES: _sweep,
    ODOMETRY: lambda message: (message.child_frame_id, pose_of(message.pose.pose)),
    IMU: lambda message: (message.header.frame_id, inertial(message)),
    POSE: lambda message: ("", pose_of(message.pose)),
    POSE_COV: lambda message: ("", pose_of(message.pose.pose)),
}
