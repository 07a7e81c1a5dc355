"""ROS 2 bags in one file; result.mcap is a run for Foxglove, rerun, RViz, evo, ros2 bag play.

/map        nav_msgs/OccupancyGrid            the final map, once, at the first stamp
/path       nav_msgs/Path                     the whole path, once, at the first stamp
/tf         map -> base_link                  per scan; base_link and laser as the log names them
/tf_static  base_link -> laser                once
/pose       geometry_msgs/PoseStamped         per scan
/scan       sensor_msgs/LaserScan             per scan, in the laser's frame
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import numpy as np

from slams.ros.maker import Maker
from slams.ros.messages import MAP_TYPE, PATH_TYPE, POSE_TYPE, SCAN_TYPE, TF_TYPE, typestore
from slams.scanlog import ScanLog
from slams.types import Floats, OccupancyGrid, Pose2

MAP_FRAME, DEFAULT_BASE_FRAME, DEFAULT_LASER_FRAME = "map", "base_link", "laser"
MAX_ROS_STAMP = 2.0**31  # s, limit of a ROS time
RESULT_TOPICS = {  # message type, and whether the topic is latched
    "/map": (MAP_TYPE, True),
    "/path": (PATH_TYPE, True),
    "/tf_static": (TF_TYPE, True),
    "/tf": (TF_TYPE, False),
    "/pose": (POSE_TYPE, False),
    "/scan": (SCAN_TYPE, False),
}


def write_mcap(path: str | Path, log: ScanLog, poses: Floats, grid: OccupancyGrid) -> None:
    """Write a run: poses (n, 3) of the log's n scans, and the final map.

    The file appears complete or not at all. Equal runs give equal bytes.

    Raises:
        OSError: it cannot be written.
    """
    make, stamps = Maker(), stamps_of(log.t)
    base, laser = frames_of(log.meta)
    with McapFile(path, RESULT_TOPICS) as file:

        def put(topic: str, stamp: int, message: Any) -> None:
            file.write(topic, stamp, typestore().serialize_cdr(message, RESULT_TOPICS[topic][0]))

        put("/map", stamps[0], make.grid(stamps[0], grid, MAP_FRAME))
        put("/path", stamps[0], make.path(stamps, poses, MAP_FRAME))
        mount = make.transforms(stamps[0], [(base, laser, log.laser.mount)])
        put("/tf_static", stamps[0], mount)
        each = zip(stamps, poses.tolist(), log.ranges, log.numbers, strict=True)
        for stamp, row, ranges, number in each:
            pose = Pose2(*row)
            put("/tf", stamp, make.transforms(stamp, [(MAP_FRAME, base, pose)]))
            put("/pose", stamp, make.pose(stamp, pose, MAP_FRAME))
            if number == 0:  # the laser whose mount is written
                readings = ranges[: log.laser.n_beams]
                scan = make.scan(stamp, laser, log.laser, readings, log.scan_period)
                put("/scan", stamp, scan)


class McapFile:
    """A ROS 2 bag in one file; as a context: renamed to its path when it ends without an error.

    Args:
        path: of the file.
        topics: message type of each topic, and whether it is latched.

    Raises:
        OSError: it cannot be written.
    """

    def __init__(self, path: str | Path, topics: Mapping[str, tuple[str, bool]]) -> None:
        from rosbags.rosbag2 import StoragePlugin, Writer

        self.path = Path(path)
        prefix = f".{self.path.name}."
        self._folder = tempfile.TemporaryDirectory(prefix=prefix, dir=self.path.parent)
        bag = Path(self._folder.name) / "bag"
        try:
            self._writer: Any = Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP)
            self._writer.open()
            self._connections = {
                topic: self._writer.add_connection(
                    topic, kind, typestore=typestore(), offered_qos_profiles=[_qos(latched)]
                )
                for topic, (kind, latched) in topics.items()
            }
        except BaseException:
            self._folder.cleanup()
            raise

    def write(self, topic: str, stamp: int, data: bytes | memoryview) -> None:
        """Store a CDR message with a time [ns]."""
        self._writer.write(self._connections[topic], stamp, data)

    def close(self, keep: bool = True) -> None:
        """Finish the file and give it its name, or delete it."""
        ignored = () if keep else (Exception,)  # the error before may occur again
        with self._folder, suppress(*ignored):
            self._writer.close()
            if keep:
                next(Path(self._folder.name).rglob("*.mcap")).replace(self.path)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        self.close(keep=kind is None)


def _qos(latched: bool) -> Any:
    """A reliable quality of service; a latched message is kept for later subscribers."""
    from rosbags import interfaces

    forever = interfaces.QosTime(sec=2147483647, nsec=4294967295)
    durability = interfaces.QosDurability
    return interfaces.Qos(
        history=interfaces.QosHistory.KEEP_LAST,
        depth=1 if latched else 10,
        reliability=interfaces.QosReliability.RELIABLE,
        durability=durability.TRANSIENT_LOCAL if latched else durability.VOLATILE,
        deadline=forever,
        lifespan=forever,
        liveliness=interfaces.QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=forever,
        avoid_ros_namespace_conventions=False,
    )


def frames_of(meta: dict[str, Any]) -> tuple[str, str]:
    """Frames of base and laser from a log's meta data; default names where it has none."""
    source = meta.get("source")
    named = source if isinstance(source, dict) else {}
    laser = _frame(named.get("laser_frame"), DEFAULT_LASER_FRAME)
    base = _frame(named.get("base_frame"), DEFAULT_BASE_FRAME)
    if base == laser:  # the laser was taken as the base
        base = DEFAULT_BASE_FRAME
        laser = DEFAULT_LASER_FRAME if laser == base else laser
    return base, laser


def _frame(name: Any, default: str) -> str:
    return name if isinstance(name, str) and name and name != MAP_FRAME else default


def stamps_of(t: Floats) -> list[int]:
    """Stamps [ns]; counted from the first scan if a ROS time cannot represent them."""
    if t.min() < 0.0 or t.max() >= MAX_ROS_STAMP:
        t = t - t.min()
    nanoseconds: list[int] = np.round(t * 1e9).astype(np.int64).tolist()
    return nanoseconds
