"""The network of ROS 1 by rospy, where that can be imported; messages become CDR and back."""

from __future__ import annotations

import os
import time
from importlib import import_module
from typing import Any

from slams.formats.bag import OLD_TF, TF, Record
from slams.formats.ros_store import store
from slams.live.wire import Quality, Taker

DEPTH = {Quality.SENSOR: 5, Quality.RELIABLE: 100, Quality.LATCHED: 1}
UNREAD = 200  # messages of a topic that wait to be taken


class Ros1Wire:
    """One node of a ROS 1 master.

    Raises:
        LookupError: rospy cannot be imported.
        ValueError: there is no master.
    """

    def __init__(self, name: str) -> None:
        try:
            self._rospy, master = import_module("rospy"), import_module("rosgraph")
        except ModuleNotFoundError as error:
            raise LookupError(
                "--ros1 needs rospy, which is not installed here: Debian has it as python3-rospy, "
                "ROS 1 brings it; its folder has to be on PYTHONPATH"
            ) from error
        if not master.is_master_online():
            at = os.environ.get("ROS_MASTER_URI", "http://localhost:11311")
            raise ValueError(f"no ROS 1 master at {at}; start roscore, or set ROS_MASTER_URI")
        self._rospy.init_node(name, anonymous=True, disable_signals=True)
        self._wanted: list[tuple[str, str, Taker]] = []
        self._subscribers: dict[str, Any] = {}

    def subscribe(self, topic: str, msgtype: str, quality: Quality, take: Taker) -> None:
        """Have `take` called for every message of a topic, after `listen`."""
        self._wanted.append((topic, msgtype, take))

    def advertise(self, topic: str, msgtype: str, quality: Quality) -> Ros1Outlet:
        """Begin to publish a topic."""
        kind = import_module("roslib.message").get_message_class(msgtype.replace("/msg/", "/"))
        latch = quality is Quality.LATCHED
        publisher = self._rospy.Publisher(topic, kind, latch=latch, queue_size=DEPTH[quality])
        return Ros1Outlet(publisher, kind, msgtype)

    def listen(self) -> None:
        """Begin to receive."""
        for topic, msgtype, take in self._wanted:
            self._subscribers[topic] = self._rospy.Subscriber(
                topic,
                self._rospy.AnyMsg,
                lambda raw, topic=topic, msgtype=msgtype, take=take: self._take(
                    raw, topic, msgtype, take
                ),
                queue_size=UNREAD,
            )

    def topics(self) -> dict[str, str]:
        """Topics that somebody publishes, with their message types."""
        return {topic: _ros2_name(kind) for topic, kind in self._rospy.get_published_topics()}

    def writers(self, topic: str) -> int:
        """How many publish a topic that is subscribed."""
        return int(self._subscribers[topic].get_num_connections())

    def close(self) -> None:
        """Leave the master."""
        self._rospy.signal_shutdown("ended")

    def _take(self, raw: Any, topic: str, msgtype: str, take: Taker) -> None:
        """Hand over a message of the type that is expected, and not of this node itself."""
        kind = _ros2_name(raw._connection_header["type"])
        if raw._connection_header["callerid"] == self._rospy.get_name():
            return
        if (TF if kind == OLD_TF else kind) == msgtype:
            received = time.time_ns()
            data = bytes(store().ros1_to_cdr(raw._buff, msgtype))
            take(Record(topic, msgtype, received, data))


class Ros1Outlet:
    """One topic that is published."""

    def __init__(self, publisher: Any, kind: Any, msgtype: str) -> None:
        self._publisher, self._kind, self._msgtype = publisher, kind, msgtype

    def send(self, data: bytes) -> None:
        """Publish a message."""
        message = self._kind()
        message.deserialize(bytes(store().cdr_to_ros1(data, self._msgtype)))
        self._publisher.publish(message)

    @property
    def readers(self) -> int:
        """How many subscribe to it now."""
        return int(self._publisher.get_num_connections())


def _ros2_name(kind: str) -> str:
    package, _, name = kind.partition("/")
    return f"{package}/msg/{name}"
