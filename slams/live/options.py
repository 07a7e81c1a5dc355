"""Options of `slams live`: topics, frames and times, with ROS's types and defaults."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, dataclass, field, fields
from enum import Enum
from typing import Any

from slams.params import MAX_LASERS
from slams.ros import messages as ros
from slams.validation import expect

HOUR = 3600.0  # s, the most that an option may be: a map in an hour is rare enough
DIAGNOSTICS_TYPE = "diagnostic_msgs/msg/DiagnosticArray"
Callback = Callable[[ros.Record], None]


class Quality(Enum):
    """Quality of service of a topic, a ROS 2 profile; the value is the publisher's queue depth."""

    SENSOR = 5  # best effort: a lost message is not sent again
    RELIABLE = 100
    LATCHED = 1  # transient local: a late subscriber receives the last message


NODE_TOPICS = {  # message type and quality of service, by default name
    "/scan": (ros.SCAN_TYPE, Quality.SENSOR),
    "/odom": (ros.ODOMETRY_TYPE, Quality.SENSOR),
    "/imu": (ros.IMU_TYPE, Quality.SENSOR),
    "/tf": (ros.TF_TYPE, Quality.RELIABLE),
    "/tf_static": (ros.TF_TYPE, Quality.LATCHED),
    "/map": (ros.MAP_TYPE, Quality.LATCHED),
    "/path": (ros.PATH_TYPE, Quality.LATCHED),
    "/pose": (ros.POSE_COV_TYPE, Quality.RELIABLE),
    "/slam/state": (DIAGNOSTICS_TYPE, Quality.RELIABLE),
}
NODE_TYPES = tuple(dict.fromkeys(msgtype for msgtype, _ in NODE_TOPICS.values()))


def topic_names(remap: Sequence[str] = ()) -> dict[str, str]:
    """Names of the topics by their default names; remap has texts as "/scan:=/front/scan".

    Raises:
        ValueError: a text has another form, or the node has no such topic.
    """
    names = {name: name for name in NODE_TOPICS}
    for text in remap:
        old, separator, new = text.partition(":=")
        is_valid = bool(separator) and new.startswith("/")
        expect(is_valid, "--remap", repr(text), "/FROM:=/TO")
        if old not in names:
            raise ValueError(f"--remap: no topic {old}; the topics are {', '.join(names)}")
        names[old] = new
    return names


def _option(metavar: str, default: Any, text: str) -> Any:
    """A field that is set by the command line option of the same name."""
    return field(default=default, metadata={"metavar": metavar, "help": text})


@dataclass(frozen=True)
class NodeOptions:
    """Options of a node; `odometry` is "auto" (tf, else the topic), "tf", "topic" or "none".

    `scans` are the lasers' topics, `names` all other topics by their default names.
    """

    scans: tuple[str, ...] = ("/scan",)
    names: Mapping[str, str] = field(default_factory=topic_names)
    odometry: str = "auto"
    imu: bool = True  # whether the node subscribes to it
    map_frame: str = _option("FRAME", "map", "frame of map and poses")
    odom_frame: str = _option("FRAME", "odom", "frame of the odometry")
    base_frame: str | None = _option(
        "FRAME",
        None,
        "frame of the robot, whose poses are published (default: the odometry's child frame, else "
        "base_link)",
    )
    map_every: float = _option("S", 2.0, "time between two published maps [s], 0 for none")
    wait: float = _option("S", 0.4, "maximum time that a scan waits for odometry and gyro [s]")
    tf_ahead: float = _option("S", 0.1, "a transform's stamp is ahead of its scan by this [s]")

    def __post_init__(self) -> None:
        for option in fields(self):
            if option.type == "float":
                value = getattr(self, option.name)
                expect(0.0 <= value <= HOUR, _flag(option), f"{value:g}", f"0 to {HOUR:g} s")
        is_valid = len(set(self.scans)) == len(self.scans) <= MAX_LASERS
        expected = f"up to {MAX_LASERS} different topics"
        expect(is_valid, "--scan-topic", ", ".join(self.scans), expected)


def add_node_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of topics, frames and times to a command."""
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
    for option in NODE_OPTIONS:
        default, text = option.default, option.metadata["help"]
        others.add_argument(
            _flag(option),
            type=float if option.type == "float" else str,
            metavar=option.metadata["metavar"],
            default=default,
            help=text if default is None else f"{text} (default: %(default)s)",
        )


def node_options(arguments: argparse.Namespace) -> NodeOptions:
    """The options of topics, frames and times.

    Raises:
        ValueError: a number is out of its bounds, or an option has no effect.
    """
    if arguments.localize and arguments.map_every != NodeOptions.map_every:
        raise ValueError("--map-every: got --localize, too, and a given map is published once")
    values: dict[str, Any] = {one.name: getattr(arguments, one.name) for one in NODE_OPTIONS}
    values["odometry"], values["imu"] = arguments.odom, arguments.imu != "none"
    names = topic_names(arguments.remap)
    if arguments.imu != "/imu":
        names["/imu"] = _with_slash(arguments.imu)
    if arguments.odom not in ("auto", "tf", "none"):
        values["odometry"], names["/odom"] = "topic", _with_slash(arguments.odom)
    scans = tuple(map(_with_slash, arguments.scan_topic or [names["/scan"]]))
    return NodeOptions(scans, names, **values)


NODE_OPTIONS = [option for option in fields(NodeOptions) if option.metadata]


def _flag(option: Field[Any]) -> str:
    return f"--{option.name.replace('_', '-')}"


def _with_slash(topic: str) -> str:
    return topic if topic.startswith("/") else f"/{topic}"
