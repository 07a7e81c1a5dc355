"""Topics, frames and times of `slams live`, with ROS's kinds and defaults."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, dataclass, field, fields
from enum import Enum
from typing import Any

from slams.params import MAX_LASERS
from slams.ros.messages import IMU, MAP, ODOMETRY, PATH, POSE_COV, SCAN, TF, Record
from slams.validation import expect

STATUS = "diagnostic_msgs/msg/DiagnosticArray"
Callback = Callable[[Record], None]


class Quality(Enum):
    """How a topic's messages are carried: ROS 2's profiles, by how many a publisher keeps."""

    SENSOR = 5  # best effort: a lost message is not sent again, the next one is newer
    RELIABLE = 100
    LATCHED = 1  # transient local: a late subscriber gets the last message


TOPICS = {  # what a node's topics carry and how, by their usual names
    "/scan": (SCAN, Quality.SENSOR),
    "/odom": (ODOMETRY, Quality.SENSOR),
    "/imu": (IMU, Quality.SENSOR),
    "/tf": (TF, Quality.RELIABLE),
    "/tf_static": (TF, Quality.LATCHED),
    "/map": (MAP, Quality.LATCHED),
    "/path": (PATH, Quality.LATCHED),
    "/pose": (POSE_COV, Quality.RELIABLE),
    "/slam/state": (STATUS, Quality.RELIABLE),
}
TYPES = tuple(dict.fromkeys(msgtype for msgtype, _ in TOPICS.values()))


def renamed(remap: Sequence[str] = ()) -> dict[str, str]:
    """Names of topics by the usual ones: remap has texts as "/scan:=/front/scan".

    Raises:
        ValueError: a text is none, or there is no such topic.
    """
    names = {name: name for name in TOPICS}
    for text in remap:
        old, between, new = text.partition(":=")
        fits = bool(between) and new.startswith("/")
        expect(fits, "--remap", repr(text), "/FROM:=/TO")
        if old not in names:
            raise ValueError(f"--remap: {old} is no topic here; there are {', '.join(names)}")
        names[old] = new
    return names


def _option(metavar: str, default: Any, text: str) -> Any:
    """A field that an option of its name sets on the command line."""
    return field(default=default, metadata={"metavar": metavar, "help": text})


@dataclass(frozen=True)
class NodeOptions:
    """How a node works; `odometry` is "auto" (tf, else the topic), "tf", "topic" or "none".

    `scans` are the topics of the lasers, `names` those of the others by their usual names.
    """

    scans: tuple[str, ...] = ("/scan",)
    names: Mapping[str, str] = field(default_factory=renamed)
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

    def __post_init__(self) -> None:
        for option in fields(self):
            if option.type == "float":
                value = getattr(self, option.name)
                expect(0.0 <= value < math.inf, _flag(option), f"{value:g}", "0 s or more")
        fits = len(set(self.scans)) == len(self.scans) <= MAX_LASERS
        most = f"up to {MAX_LASERS} different topics"
        expect(fits, "--scan-topic", ", ".join(self.scans), most)


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
            type=float if option.type == "float" else str,
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
    names = renamed(arguments.remap)
    if arguments.imu != "/imu":
        names["/imu"] = _absolute(arguments.imu)
    if arguments.odom not in ("auto", "tf", "none"):
        values["odometry"], names["/odom"] = "topic", _absolute(arguments.odom)
    scans = tuple(map(_absolute, arguments.scan_topic or [names["/scan"]]))
    return NodeOptions(scans, names, **values)


OPTIONS = [option for option in fields(NodeOptions) if option.metadata]


def _flag(option: Field[Any]) -> str:
    return f"--{option.name.replace('_', '-')}"


def _absolute(topic: str) -> str:
    return topic if topic.startswith("/") else f"/{topic}"
