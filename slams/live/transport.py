"""Transport to ROS 2 without ROS: DDS by the cyclonedds wheel (extra `live`), messages in CDR.

The DDS types are built from the message definitions of rosbags. Messages are passed on as CDR
bytes, as bags store them, and are not unpacked here: 1081 ranges cost a hundredth of a millisecond.
"""

from __future__ import annotations

import os
import threading
import time
from functools import cache
from typing import Any

from cyclonedds import core
from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl import types as idl_types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from slams.live.options import Callback, Quality
from slams.ros.messages import Record, typestore

MAX_UNREAD_MESSAGES = 200  # queued per topic
RECEIVE_TIMEOUT = 0.1  # s that the receiving thread waits before it checks whether to end
MAX_BLOCKING_TIME = 0.1  # s that a writer may wait for slow readers, as in ROS
MAX_DOMAIN_ID = 232  # DDS has no ports for larger ones
LOOPBACK_CONFIG = """<CycloneDDS><Domain><General><Interfaces>
<NetworkInterface address="127.0.0.1" multicast="true"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32
</MaxAutoParticipantIndex><Peers><Peer address="localhost"/></Peers></Discovery>
</Domain></CycloneDDS>"""

types: Any = idl_types
_domains: dict[int, Any] = {}  # a process can configure a domain only once


class Transport:
    """One participant of a DDS domain.

    Args:
        domain: domain number, as ROS_DOMAIN_ID.
        localhost: reach this machine only. CYCLONEDDS_URI, if set, overrides it.

    Raises:
        ValueError: no such domain, or DDS finds no network.
    """

    def __init__(self, domain: int = 0, localhost: bool = False) -> None:
        if not 0 <= domain <= MAX_DOMAIN_ID:
            raise ValueError(f"domain: got {domain}, expected 0 to {MAX_DOMAIN_ID}")
        try:
            if localhost and "CYCLONEDDS_URI" not in os.environ and domain not in _domains:
                _domains[domain] = Domain(domain, LOOPBACK_CONFIG)
            self._participant: Any = DomainParticipant(domain)
        except core.DDSException as error:
            raise ValueError(
                f"DDS cannot join domain {domain} ({error}); is there a network, and does "
                "CYCLONEDDS_URI, if it is set, name one of its interfaces?"
            ) from error
        self._readers: dict[str, tuple[Any, str, Callback]] = {}
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._receive, name="dds", daemon=True)
        self._published: Any = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)

    def subscribe(self, topic: str, msgtype: str, quality: Quality, callback: Callback) -> None:
        """Call a callback for every message of a topic; to be used before `listen`."""
        qos = _qos(quality, MAX_UNREAD_MESSAGES)  # for all writers of the topic together
        reader = DataReader(self._participant, self._topic(topic, msgtype), qos)
        self._readers[topic] = (reader, msgtype, callback)

    def advertise(self, topic: str, msgtype: str, quality: Quality) -> Publisher:
        """The publisher of a topic."""
        qos = _qos(quality, quality.value)
        writer = DataWriter(self._participant, self._topic(topic, msgtype), qos)
        return Publisher(writer, msgtype)

    def listen(self) -> None:
        """Start the thread that receives messages."""
        self._thread.start()

    def published(self, msgtype: str) -> list[str]:
        """Names of topics that have a publisher of a message type, sorted."""
        alive, name = core.InstanceState.Alive, type_name(msgtype)
        found = [e for e in self._published.read(10_000) if e.type_name == name]
        topics = {e.topic_name for e in found if e.sample_info.instance_state == alive}
        return sorted(topic[2:] for topic in topics if topic.startswith("rt/"))

    def close(self) -> None:
        """Leave the domain; this ends all publishers and subscriptions."""
        self._end.set()
        if self._thread.is_alive():
            self._thread.join()
        self._readers.clear()
        self._published = self._participant = None

    def _topic(self, topic: str, msgtype: str) -> Any:
        try:
            return Topic(self._participant, f"rt/{topic.lstrip('/')}", message_type(msgtype))
        except core.DDSException as error:
            raise ValueError(f"{topic!r} is not a valid topic name for DDS ({error})") from error

    def _receive(self) -> None:
        """Call the callbacks for messages as they arrive, until the end."""
        waiting, new = core.WaitSet(self._participant), core.SampleState.NotRead
        for reader, _, _ in self._readers.values():
            mask = core.ViewState.Any | core.InstanceState.Any | new
            waiting.attach(core.ReadCondition(reader, mask))
        while not self._end.is_set():
            waiting.wait(duration(seconds=RECEIVE_TIMEOUT))
            received = time.time_ns()
            for topic, (reader, msgtype, callback) in self._readers.items():
                for one in reader.take(MAX_UNREAD_MESSAGES):
                    if hasattr(one, "cdr"):  # samples without data report that a writer has left
                        callback(Record(topic, msgtype, received, one.cdr))


class Publisher:
    """Publishes one topic."""

    def __init__(self, writer: Any, msgtype: str) -> None:
        self._writer, self._msgtype = writer, msgtype

    def publish(self, data: bytes) -> None:
        """Send a message.

        Raises:
            OSError: DDS does not accept it.
        """
        try:
            self._writer.write(_sample_of_bytes(message_type(self._msgtype), data))
        except core.DDSException as error:
            raise OSError(f"DDS does not accept a {self._msgtype}: {error}") from error

    @property
    def subscribers(self) -> int:
        """Current number of subscribers."""
        return len(self._writer.get_matched_subscriptions())


def _qos(quality: Quality, depth: int) -> Any:
    reliable = core.Policy.Reliability.Reliable(duration(seconds=MAX_BLOCKING_TIME))
    best_effort = core.Policy.Reliability.BestEffort
    durability = core.Policy.Durability
    return core.Qos(
        best_effort if quality is Quality.SENSOR else reliable,
        durability.TransientLocal if quality is Quality.LATCHED else durability.Volatile,
        core.Policy.History.KeepLast(depth),
        core.Policy.IgnoreLocal.Participant,
        core.Policy.DataRepresentation(use_cdrv0_representation=True),
    )


def type_name(msgtype: str) -> str:
    """The DDS name of a ROS message: "sensor_msgs::msg::dds_::LaserScan_"."""
    package, kind, name = msgtype.split("/")
    return f"{package}::{kind}::dds_::{name}_"


@cache
def message_type(msgtype: str) -> Any:
    """The DDS type of a ROS message; its samples hold the CDR bytes in `cdr`."""
    members = {name: _field_type(kind) for name, kind in typestore().fielddefs[msgtype][1]}
    name = msgtype.rpartition("/")[2]
    kind: Any = make_idl_struct(name, type_name(msgtype), members, dataclassify=False)
    kind.serialize = lambda self, **_: self.cdr
    kind.deserialize = classmethod(lambda cls, data, **_: _sample_of_bytes(cls, data))
    kind.deserialize_key = classmethod(lambda *_, **__: None)  # for samples without data
    return kind


def _sample_of_bytes(kind: Any, data: bytes) -> Any:
    sample = kind.__new__(kind)
    sample.cdr = data
    return sample


def _field_type(kind: Any) -> Any:
    """The DDS type of a message field, from the field type of rosbags."""
    content = kind[1]
    if kind[0].name == "NAME":
        return message_type(content)
    if kind[0].name == "BASE":
        builtin = {"bool": bool, "string": str, "byte": types.uint8}
        return builtin.get(content[0]) or getattr(types, content[0])
    element, length = _field_type(content[0]), content[1]
    if kind[0].name == "ARRAY":
        return types.array[element, length]
    return types.sequence[(element, *([length] if length else []))]
