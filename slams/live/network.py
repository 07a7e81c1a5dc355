"""Network options of the live commands, with ROS's defaults."""

from __future__ import annotations

import argparse
import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from slams.live.transport import Transport


def add_network_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ROS 2's network to a command."""
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
    group.add_argument(
        "--remap",
        metavar="FROM:=TO",
        action="append",
        default=[],
        help="rename a topic, as /scan:=/front/scan; may be given again",
    )


def transport_of(arguments: argparse.Namespace) -> Transport:
    """The transport on the network that the options name.

    Raises:
        LookupError: cyclonedds is not installed.
        ValueError: no such domain, or no network.
    """
    try:
        from slams.live.transport import Transport
    except ModuleNotFoundError as error:
        raise LookupError(
            "the DDS library is not installed: pip install 'cyclonedds==11.*'"
        ) from error
    domain: int | None = arguments.domain_id
    if domain is None:
        text = os.environ.get("ROS_DOMAIN_ID", "") or "0"
        if not text.isdecimal():
            raise ValueError(f"ROS_DOMAIN_ID: got {text!r}, expected a number")
        domain = int(text)
    local = os.environ.get("ROS_LOCALHOST_ONLY") == "1"  # ROS 2 Humble; the next line is for Jazzy
    local |= os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").upper() == "LOCALHOST"
    return Transport(domain, arguments.localhost_only or local)
