"""result.mcap: a run as a ROS 2 bag of one file, for Foxglove, rerun, RViz, evo, ros2 bag play.

/map        nav_msgs/OccupancyGrid            the final map, once, at the first stamp
/path       nav_msgs/Path                     the whole way, once, at the first stamp
/tf         map -> base_link                  per scan; base_link and laser as the log names them
/tf_static  base_link -> laser                once
/pose       geometry_msgs/PoseStamped         per scan
/scan       sensor_msgs/LaserScan             per scan, in the laser's frame
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from slams.formats.bag import store
from slams.formats.mcap_file import McapFile
from slams.formats.ros_maker import Maker
from slams.scanlog import ScanLog
from slams.types import Floats, OccupancyGrid, Pose2

MAP, BASE, LASER = "map", "base_link", "laser"
LAST_STAMP = 2.0**31  # [s], as much as a ROS time holds
ONCE = ("/map", "/path", "/tf_static")  # kept for later subscribers, as live nodes do
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
    make, stamps = Maker(), stamps_of(log.t)
    base, laser = frames_of(log.meta)
    with McapFile(path, TYPES, ONCE) as file:

        def put(topic: str, stamp: int, message: Any) -> None:
            file.write(topic, stamp, store().serialize_cdr(message, TYPES[topic]))

        put("/map", stamps[0], make.grid(stamps[0], grid, MAP))
        put("/path", stamps[0], make.path(stamps, poses, MAP))
        mount = make.transforms(stamps[0], [(base, laser, log.laser.mount)])
        put("/tf_static", stamps[0], mount)
        each = zip(stamps, poses.tolist(), log.ranges, log.numbers, strict=True)
        for stamp, row, ranges, number in each:
            pose = Pose2(*row)
            put("/tf", stamp, make.transforms(stamp, [(MAP, base, pose)]))
            put("/pose", stamp, make.pose(stamp, pose, MAP))
            if number == 0:  # the laser of the transform
                seen = ranges[: log.laser.n_beams]
                scan = make.scan(stamp, laser, log.laser, seen, log.scan_period)
                put("/scan", stamp, scan)


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


def stamps_of(t: Floats) -> list[int]:
    """Stamps [ns]; counted from the first scan where a ROS time cannot hold them."""
    if t.min() < 0.0 or t.max() >= LAST_STAMP:
        t = t - t.min()
    nanoseconds: list[int] = np.round(t * 1e9).astype(np.int64).tolist()
    return nanoseconds
