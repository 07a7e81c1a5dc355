"""Options of the network, for the node and for the player."""

from __future__ import annotations

import argparse
import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from slams.live.wire import Wire


def add_network_options(parser: argparse.ArgumentParser) -> None:
    """Give a command the options of where its messages go."""
    group = parser.add_argument_group("network", "ROS 2 by DDS, with ROS's names and settings")
    group.add_argument("--domain-id", type=int, metavar="N", help="default: ROS_DOMAIN_ID, else 0")
    group.add_argument(
        "--localhost-only",
        action="store_true",
        help="speak to this machine only, as ROS_LOCALHOST_ONLY=1 says, too",
    )
    group.add_argument(
        "--ros1", action="store_true", help="ROS 1 instead, where rospy can be imported"
    )


def wire_of(arguments: argparse.Namespace, name: str) -> Wire:
    """The network that the options name; `name` is what a ROS 1 node is called.

    Raises:
        LookupError: cyclonedds, or rospy, is not installed.
        ValueError: the domain is none, or there is no network.
    """
    if arguments.ros1:
        from slams.live.ros1 import Ros1Wire

        return Ros1Wire(name)
    from slams.live.dds import DdsWire

    return DdsWire(_domain(arguments.domain_id), arguments.localhost_only or _localhost())


def _domain(asked: int | None) -> int:
    text = os.environ.get("ROS_DOMAIN_ID", "") or "0"
    if asked is not None:
        return asked
    if not text.isdecimal():
        raise ValueError(f"ROS_DOMAIN_ID: got {text!r}, expected a number")
    return int(text)


def _localhost() -> bool:
    """Whether ROS's variables, of Humble or of Jazzy, keep messages on this machine."""
    reach = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").upper()
    return reach == "LOCALHOST" or os.environ.get("ROS_LOCALHOST_ONLY") == "1"
