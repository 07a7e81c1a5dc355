"""Topics, frames, times and network of the live commands, with ROS's defaults."""

from __future__ import annotations

import argparse
import math
import os
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from slams.params import MAX_LASERS

if TYPE_CHECKING:
    from slams.live.transport import Transport


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


@dataclass(frozen=True)
class NodeOptions:
    """How a node works.

    Attributes:
        topics: their names.
        map_frame: the frame of map and poses.
        odom_frame: the odometry's frame.
        base_frame: the frame that poses are of; None: what the odometry is of, else base_link.
        odometry: "auto" (tf, else the topic), "tf", "topic" or "none".
        imu: whether the gyro is subscribed.
        queue: scans that wait at most.
        wait: for odometry and gyro to catch up with a scan [s].
        map_every: time between two maps [s]; 0 for none.
        tf_ahead: how far ahead of its scan a transform is stamped, so that it holds until the
            next one [s].
    """

    topics: Topics = Topics()
    map_frame: str = "map"
    odom_frame: str = "odom"
    base_frame: str | None = None
    odometry: str = "auto"
    imu: bool = True
    queue: int = 20
    wait: float = 0.4
    map_every: float = 2.0
    tf_ahead: float = 0.1

    def __post_init__(self) -> None:
        for name in (f.name for f in fields(self) if f.type == "float"):
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise ValueError(f"--{name.replace('_', '-')}: got {value:g}, expected 0 s or more")
        lasers = self.topics.scans
        if not len(set(lasers)) == len(lasers) <= MAX_LASERS:
            got = ", ".join(lasers)
            raise ValueError(
                f"--scan-topic: got {got}, expected up to {MAX_LASERS} different topics"
            )
        if self.queue < 1:
            raise ValueError(f"--queue: got {self.queue}, expected 1 scan or more")


def add_network_options(parser: argparse.ArgumentParser) -> None:
    """Give a command the options of ROS 2's network."""
    group = parser.add_argument_group(
        "network", "ROS 2's network protocol (DDS), with the names and settings of ROS"
    )
    group.add_argument(
        "--domain-id", type=int, metavar="N", help="DDS domain (default: ROS_DOMAIN_ID, else 0)"
    )
    group.add_argument(
        "--localhost-only",
        action="store_true",
        help="reach programs on this machine only, as ROS_LOCALHOST_ONLY=1 does",
    )


def transport_of(arguments: argparse.Namespace) -> Transport:
    """The network that the options name.

    Raises:
        LookupError: cyclonedds is not installed.
        ValueError: no such domain, or no network.
    """
    from slams.live.transport import Transport

    domain: int | None = arguments.domain_id
    if domain is None:
        text = os.environ.get("ROS_DOMAIN_ID", "") or "0"
        if not text.isdecimal():
            raise ValueError(f"ROS_DOMAIN_ID: got {text!r}, expected a number")
        domain = int(text)
    local = os.environ.get("ROS_LOCALHOST_ONLY") == "1"  # of Humble; the next one of Jazzy
    local |= os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").upper() == "LOCALHOST"
    return Transport(domain, arguments.localhost_only or local)
