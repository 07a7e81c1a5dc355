"""What a node asks of the network, whatever carries the messages: topics in, topics out."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Protocol

from slams.formats.bag import IMU, ODOMETRY, POSE_COV, SCAN, TF, Record

MAP, STATUS = "nav_msgs/msg/OccupancyGrid", "diagnostic_msgs/msg/DiagnosticArray"
TYPES = (SCAN, ODOMETRY, IMU, TF, MAP, POSE_COV, STATUS)

Taker = Callable[[Record], None]


class Quality(Enum):
    """How a topic's messages are carried: ROS 2's profiles, as far as they are needed."""

    SENSOR = "best effort"  # what is lost is lost: the next one is newer
    RELIABLE = "reliable"
    LATCHED = "transient local"  # and the last one stays for who comes later


class Outlet(Protocol):
    """One topic that is published."""

    def send(self, data: bytes) -> None:
        """Publish a message, CDR with its header."""
        ...

    @property
    def readers(self) -> int:
        """How many subscribe to it now."""
        ...


class Wire(Protocol):
    """The network: messages are CDR whatever it is."""

    def subscribe(self, topic: str, msgtype: str, quality: Quality, take: Taker) -> None:
        """Have `take` called, in a thread of the network's, for every message of a topic."""
        ...

    def advertise(self, topic: str, msgtype: str, quality: Quality) -> Outlet:
        """Begin to publish a topic."""
        ...

    def listen(self) -> None:
        """Begin to receive, after all is subscribed."""
        ...

    def topics(self) -> dict[str, str]:
        """Topics that somebody publishes, with their message types."""
        ...

    def writers(self, topic: str) -> int:
        """How many publish a topic that is subscribed."""
        ...

    def close(self) -> None:
        """Leave the network."""
        ...
