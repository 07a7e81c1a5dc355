"""The network of a node, whatever carries its messages: topics in, topics out, all in CDR."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Protocol

from slams.formats.bag import IMU, ODOMETRY, POSE_COV, SCAN, TF, Record

MAP, STATUS = "nav_msgs/msg/OccupancyGrid", "diagnostic_msgs/msg/DiagnosticArray"
TYPES = (SCAN, ODOMETRY, IMU, TF, MAP, POSE_COV, STATUS)

Callback = Callable[[Record], None]


class Quality(Enum):
    """How a topic's messages are carried: ROS 2's profiles, as far as they are needed."""

    SENSOR = "best effort"  # a lost message is not sent again: the next one is newer
    RELIABLE = "reliable"
    LATCHED = "transient local"  # a late subscriber gets the last message


class Publisher(Protocol):
    """One topic that is published."""

    def publish(self, data: bytes) -> None:
        """Send a message, CDR with its header; OSError where the network does not take it."""
        ...

    @property
    def subscribers(self) -> int:
        """How many subscribe to it now."""
        ...


class Transport(Protocol):
    """A participant of the network."""

    def subscribe(self, topic: str, msgtype: str, quality: Quality, callback: Callback) -> None:
        """Have a callback called for every message of a topic, in a thread of the transport."""
        ...

    def advertise(self, topic: str, msgtype: str, quality: Quality) -> Publisher:
        """Begin to publish a topic."""
        ...

    def listen(self) -> None:
        """Begin to receive, after all is subscribed."""
        ...

    def topics(self) -> dict[str, str]:
        """Topics that have a publisher, with their message types."""
        ...

    def publishers(self, topic: str) -> int:
        """How many publish a topic that is subscribed."""
        ...

    def close(self) -> None:
        """Leave the network."""
        ...
