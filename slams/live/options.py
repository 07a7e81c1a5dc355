"""Topics, frames and times of `slams live`, with ROS's kinds and defaults."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import Field, asdict, dataclass, field, fields, replace
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


@dataclass(frozen=True)
class Topics:
    """Names of the topics in and out."""

    scans: tuple[str, ...] = ("/scan",)  # of the lasers
    odom: str = "/odom"
    imu: str = "/imu"
    tf: str = "/tf"
    tf_static: str = "/tf_static"
    map: str = "/map"
    path: str = "/path"
    pose: str = "/pose"
    state: str = "/slam/state"


def topics_of(remap: Sequence[str]) -> Topics:
    """The usual names of topics, some replaced: remap has texts as "/scan:=/front/scan".

    Raises:
        ValueError: a text is none, or there is no such topic.
    """
    names = asdict(Topics())
    usual = {"/scan": "scans"} | {name: key for key, name in names.items() if key != "scans"}
    for text in remap:
        old, between, new = text.partition(":=")
        if not (between and new.startswith("/")):
            raise ValueError(f"--remap: got {text!r}, expected /FROM:=/TO")
        if old not in usual:
            raise ValueError(f"--remap: {old} is no topic here; there are {', '.join(usual)}")
        names[usual[old]] = new if old != "/scan" else (new,)
    return Topics(**names)


def _option(metavar: str, default: Any, text: str) -> Any:
    """A field that an option of its name sets on the command line."""
    return field(default=default, metadata={"metavar": metavar, "help": text})


@dataclass(frozen=True)
class NodeOptions:
    """How a node works; `odometry` is "auto" (tf, else the topic), "tf", "topic" or "none"."""

    topics: Topics = Topics()
    odometry: str = "auto"
    imu: bool = True  # whether it is subscribed
    map_frame: str = _option("FRAME", "map", "frame of map and poses")
    odom_frame: str = _option("FRAME", "odom", "frame of the odometry")
    base_frame: str | None = _option(
        "FRAME",
        None,
        "frame of the robot, whose poses are published (default: that of the odometry, else "
        "base_link)",
    )
    map_every: float = _option("S", 2.0, "time between two published maps [s], 0 for none")
    wait: float = _option("S", 0.4, "how long a scan waits for odometry and gyro at most [s]")
    tf_ahead: float = _option("S", 0.1, "how far ahead of its scan a transform is stamped [s]")
    queue: int = _option("N", 20, "how many scans wait at most; older ones are left out")

    def __post_init__(self) -> None:
        for option in fields(self):
            value = getattr(self, option.name)
            if option.type == "float" and not 0.0 <= value < math.inf:
                raise ValueError(f"{_flag(option)}: got {value:g}, expected 0 s or more")
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
    topics.add_argument(
        "--imu",
        metavar="TOPIC",
        default="/imu",
        help="subscribed gyro and attitude, or none (default: %(default)s)",
    )
    for option in OPTIONS:
        usual, text = option.default, option.metadata["help"]
        others.add_argument(
            _flag(option),
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
    values: dict[str, Any] = {option.name: getattr(arguments, option.name) for option in OPTIONS}
    values["odometry"], values["imu"] = arguments.odom, arguments.imu != "none"
    chosen: dict[str, Any] = {}
    if arguments.imu != Topics.imu:
        chosen["imu"] = _absolute(arguments.imu)
    if arguments.scan_topic:
        chosen["scans"] = tuple(map(_absolute, arguments.scan_topic))
    if arguments.odom not in ("auto", "tf", "none"):
        values["odometry"], chosen["odom"] = "topic", _absolute(arguments.odom)
    return NodeOptions(replace(topics_of(arguments.remap), **chosen), **values)


OPTIONS = [option for option in fields(NodeOptions) if option.metadata]


def _flag(option: Field[Any]) -> str:
    return f"--{option.name.replace('_', '-')}"


def _absolute(topic: str) -> str:
    return topic if topic.startswith("/") else f"/{topic}"
