"""Topics, frames and times of `slams live`, with ROS's kinds and defaults."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import Field, dataclass, field, fields
from enum import Enum
from typing import Any

from slams.formats.bag import IMU, ODOMETRY, PATH, POSE_COV, SCAN, TF, Record
from slams.params import MAX_LASERS

MAP, STATUS = "nav_msgs/msg/OccupancyGrid", "diagnostic_msgs/msg/DiagnosticArray"
Callback = Callable[[Record], None]


class Quality(Enum):
    """How a topic's messages are carried: ROS 2's profiles, as far as they are needed."""

    SENSOR = "best effort"  # a lost message is not sent again: the next one is newer
    RELIABLE = "reliable"
    LATCHED = "transient local"  # a late subscriber gets the last message


SCANS = SCAN, Quality.SENSOR
KINDS = {  # what a node's other topics carry and how, by the names that `Topics` has for them
    "odom": (ODOMETRY, Quality.SENSOR),
    "imu": (IMU, Quality.SENSOR),
    "tf": (TF, Quality.RELIABLE),
    "tf_static": (TF, Quality.LATCHED),
    "map": (MAP, Quality.LATCHED),
    "path": (PATH, Quality.LATCHED),
    "pose": (POSE_COV, Quality.RELIABLE),
    "state": (STATUS, Quality.RELIABLE),
}
TYPES = tuple(dict.fromkeys(msgtype for msgtype, _ in (SCANS, *KINDS.values())))


def _option(flag: str, metavar: str, default: Any, text: str) -> Any:
    """A field that the command line sets, where a flag of its own name, or another one, does."""
    return field(default=default, metadata={"flag": flag, "metavar": metavar, "help": text})


@dataclass(frozen=True)
class Topics:
    """Names of the topics in and out."""

    scans: tuple[str, ...] = ("/scan",)  # of the lasers
    odom: str = "/odom"
    imu: str = _option("--imu", "TOPIC", "/imu", "subscribed gyro and attitude, or none")
    tf: str = "/tf"
    tf_static: str = "/tf_static"
    map: str = _option("--map-topic", "TOPIC", "/map", "published map")
    path: str = _option("--path-topic", "TOPIC", "/path", "path, published after a closed loop")
    pose: str = _option("--pose-topic", "TOPIC", "/pose", "published pose")
    state: str = _option("--state-topic", "TOPIC", "/slam/state", "published state")


@dataclass(frozen=True)
class NodeOptions:
    """How a node works; `odometry` is "auto" (tf, else the topic), "tf", "topic" or "none"."""

    topics: Topics = Topics()
    odometry: str = "auto"
    imu: bool = True  # whether it is subscribed
    map_frame: str = _option("--map-frame", "FRAME", "map", "frame of map and poses")
    odom_frame: str = _option("--odom-frame", "FRAME", "odom", "frame of the odometry")
    base_frame: str | None = _option(
        "--base-frame",
        "FRAME",
        None,
        "frame of the robot, whose poses are published (default: that of the odometry, else "
        "base_link)",
    )
    map_every: float = _option(
        "--map-every", "S", 2.0, "time between two published maps [s], 0 for none"
    )
    wait: float = _option(
        "--wait", "S", 0.4, "how long a scan waits for odometry and gyro at most [s]"
    )
    tf_ahead: float = _option(
        "--tf-ahead", "S", 0.1, "how far ahead of its scan a transform is stamped [s]"
    )
    queue: int = _option("--queue", "N", 20, "how many scans wait at most; older ones are left out")

    def __post_init__(self) -> None:
        for option in fields(self):
            value = getattr(self, option.name)
            if option.type == "float" and not 0.0 <= value < math.inf:
                raise ValueError(f"{option.metadata['flag']}: got {value:g}, expected 0 s or more")
        lasers = self.topics.scans
        if not len(set(lasers)) == len(lasers) <= MAX_LASERS:
            got = ", ".join(lasers)
            raise ValueError(
                f"--scan-topic: got {got}, expected up to {MAX_LASERS} different topics"
            )
        if self.queue < 1:
            raise ValueError(f"--queue: got {self.queue}, expected 1 scan or more")


def add_node_options(parser: argparse.ArgumentParser) -> None:
    """Give a command the options of topics, frames and times."""
    topics, others = map(parser.add_argument_group, ("topics", "frames and times"))
    topics.add_argument(
        "--scan-topic",
        metavar="TOPIC",
        action="append",
        help="subscribed scans (default: /scan); given several times: lasers used together",
    )
    topics.add_argument(
        "--odom",
        metavar="TOPIC",
        default="auto",
        help="odometry: auto (tf if it has the odometry's frame, else /odom), tf, a topic or none",
    )
    for group, kind in ((topics, Topics), (others, NodeOptions)):
        for option in _options(kind):
            usual, text = option.default, option.metadata["help"]
            group.add_argument(
                option.metadata["flag"],
                type=str if usual is None else type(usual),
                metavar=option.metadata["metavar"],
                default=usual,
                help=text if usual is None else f"{text} (default: %(default)s)",
            )


def node_options(arguments: argparse.Namespace) -> NodeOptions:
    """The options of topics, frames and times.

    Raises:
        ValueError: a number is out of its bounds, or means nothing.
    """
    if arguments.localize and arguments.map_every != NodeOptions.map_every:
        raise ValueError("--map-every: got --localize, too, whose map is published once")
    names, values = _given(Topics, arguments), _given(NodeOptions, arguments)
    names["scans"] = arguments.scan_topic or Topics.scans
    values["odometry"], values["imu"] = arguments.odom, names["imu"] != "none"
    if arguments.odom not in ("auto", "tf", "none"):
        values["odometry"], names["odom"] = "topic", arguments.odom
    names = {
        name: _absolute(topic) if isinstance(topic, str) else tuple(map(_absolute, topic))
        for name, topic in names.items()
    }
    return NodeOptions(Topics(**names), **values)


def _options(kind: type) -> list[Field[Any]]:
    return [option for option in fields(kind) if option.metadata]


def _given(kind: type, arguments: argparse.Namespace) -> dict[str, Any]:
    """The fields that the command line has set."""
    flags = {option.name: option.metadata["flag"] for option in _options(kind)}
    return {name: getattr(arguments, flag[2:].replace("-", "_")) for name, flag in flags.items()}


def _absolute(topic: str) -> str:
    return topic if topic.startswith("/") else f"/{topic}"
