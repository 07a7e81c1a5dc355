"""result.mcap: a run as a ROS 2 bag of one file, for Foxglove, rerun, RViz, evo, ros2 bag play.

/map        nav_msgs/OccupancyGrid            the final map, once, at the first stamp
/path       nav_msgs/Path                     the whole way, once, at the first stamp
/tf         map -> base_link                  per scan; base_link and laser as the log names them
/tf_static  base_link -> laser                once
/pose       geometry_msgs/PoseStamped         per scan
/scan       sensor_msgs/LaserScan             per scan, in the laser's frame
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slams.scanlog import ScanLog
from slams.types import Floats, Laser, OccupancyGrid, Pose2, Ranges

MAP, BASE, LASER = "map", "base_link", "laser"
LAST_STAMP = 2.0**31  # [s], as much as a ROS time holds
ONCE = ("/map", "/path", "/tf_static")  # kept for who comes later, as live nodes do
TYPES = {
    "/map": "nav_msgs/msg/OccupancyGrid",
    "/path": "nav_msgs/msg/Path",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/pose": "geometry_msgs/msg/PoseStamped",
    "/scan": "sensor_msgs/msg/LaserScan",
}


def write_mcap(path: str | Path, log: ScanLog, poses: Floats, grid: OccupancyGrid) -> None:
    """Write a run: poses (n, 3) of the log's n scans, and the map they gave.

    The file appears whole or not at all. Equal runs give equal bytes.

    Raises:
        OSError: it cannot be written.
    """
    path = Path(path)
    with tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as folder:
        bag = Path(folder) / "bag"
        _write_bag(bag, log, poses, grid)
        next(bag.glob("*.mcap")).replace(path)


def _write_bag(bag: Path, log: ScanLog, poses: Floats, grid: OccupancyGrid) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    make = _Messages(store.types)
    stamps = _stamps(log.t)
    base, laser = frames_of(log.meta)
    with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        write = _writing(writer, store)
        write("/map", stamps[0], make.grid(stamps[0], grid))
        write("/path", stamps[0], make.path(stamps, poses))
        write("/tf_static", stamps[0], make.transform(stamps[0], base, laser, log.laser.mount))
        for stamp, pose, ranges in zip(stamps, poses.tolist(), log.ranges, strict=True):
            write("/tf", stamp, make.transform(stamp, MAP, base, Pose2(*pose)))
            write("/pose", stamp, make.pose(stamp, Pose2(*pose)))
            write("/scan", stamp, make.scan(stamp, laser, log.laser, ranges, log.scan_period))


def _writing(writer: Any, store: Any) -> Callable[[str, int, Any], None]:
    """What writes a message to a topic at a time [ns]."""
    connections = {
        topic: writer.add_connection(
            topic, msgtype, typestore=store, offered_qos_profiles=[_qos(topic in ONCE)]
        )
        for topic, msgtype in TYPES.items()
    }

    def write(topic: str, stamp: int, message: Any) -> None:
        """Serialize and store."""
        data = store.serialize_cdr(message, TYPES[topic])
        writer.write(connections[topic], stamp, data)

    return write


def _qos(once: bool) -> Any:
    """Reliable; what is sent once stays for who subscribes later."""
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    forever = QosTime(sec=2147483647, nsec=4294967295)
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=1 if once else 10,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if once else QosDurability.VOLATILE,
        deadline=forever,
        lifespan=forever,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=forever,
        avoid_ros_namespace_conventions=False,
    )


def frames_of(meta: dict[str, Any]) -> tuple[str, str]:
    """Base and laser as the log calls them; by their usual names where it does not tell."""
    source = meta.get("source")
    named = source if isinstance(source, dict) else {}
    laser = _frame(named.get("laser_frame"), LASER)
    base = _frame(named.get("base_frame"), BASE)
    if base == laser:  # the laser was taken as the base
        base, laser = BASE, LASER if laser == BASE else laser
    return base, laser


def _frame(name: Any, usual: str) -> str:
    return name if isinstance(name, str) and name and name != MAP else usual


def _stamps(t: Floats) -> list[int]:
    """Stamps [ns]; counted from the first scan where a ROS time cannot hold them."""
    if t.min() < 0.0 or t.max() >= LAST_STAMP:
        t = t - t.min()
    nanoseconds: list[int] = np.round(t * 1e9).astype(np.int64).tolist()
    return nanoseconds


class _Messages:
    """Makes messages of the classes of a type store."""

    def __init__(self, types: Any) -> None:
        self.types = types

    def grid(self, stamp: int, grid: OccupancyGrid) -> Any:
        """The map in percent, -1 where nothing was seen."""
        ny, nx = grid.p.shape
        origin = self._pose(Pose2(grid.origin[0], grid.origin[1], 0.0))
        info = self._of(
            "nav_msgs/msg/MapMetaData", self._time(stamp), grid.resolution, nx, ny, origin
        )
        return self._of("nav_msgs/msg/OccupancyGrid", self._header(stamp, MAP), info, percent(grid))

    def path(self, stamps: list[int], poses: Floats) -> Any:
        """All poses."""
        every = [
            self.pose(stamp, Pose2(*pose))
            for stamp, pose in zip(stamps, poses.tolist(), strict=True)
        ]
        return self._of("nav_msgs/msg/Path", self._header(stamps[0], MAP), every)

    def pose(self, stamp: int, pose: Pose2) -> Any:
        """A pose in the map."""
        header = self._header(stamp, MAP)
        return self._of("geometry_msgs/msg/PoseStamped", header, self._pose(pose))

    def transform(self, stamp: int, parent: str, child: str, pose: Pose2) -> Any:
        """One frame in another."""
        position = self._of("geometry_msgs/msg/Vector3", pose.x, pose.y, 0.0)
        transform = self._of("geometry_msgs/msg/Transform", position, self._rotation(pose))
        item = self._of(
            "geometry_msgs/msg/TransformStamped", self._header(stamp, parent), child, transform
        )
        return self._of("tf2_msgs/msg/TFMessage", [item])

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

    def _of(self, msgtype: str, *fields: Any) -> Any:
        return self.types[msgtype](*fields)

    def _time(self, stamp: int) -> Any:
        return self._of("builtin_interfaces/msg/Time", *divmod(stamp, 10**9))

    def _header(self, stamp: int, frame: str) -> Any:
        return self._of("std_msgs/msg/Header", self._time(stamp), frame)

    def _pose(self, pose: Pose2) -> Any:
        position = self._of("geometry_msgs/msg/Point", pose.x, pose.y, 0.0)
        return self._of("geometry_msgs/msg/Pose", position, self._rotation(pose))

    def _rotation(self, pose: Pose2) -> Any:
        half = 0.5 * pose.theta
        return self._of("geometry_msgs/msg/Quaternion", 0.0, 0.0, math.sin(half), math.cos(half))


def percent(grid: OccupancyGrid) -> NDArray[np.int8]:
    """Cells row by row from the lowest y, 0 free to 100 occupied, -1 never observed."""
    known = np.isfinite(grid.p)
    cells = np.where(known, np.round(100.0 * np.where(known, grid.p, 0.0)), -1.0)
    return cells.astype(np.int8).ravel()
