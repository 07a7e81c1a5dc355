"""The network of ROS 2 without ROS: DDS by the cyclonedds wheel (extra `live`), messages in CDR.

DDS knows the library's definitions, named and laid out as ROS's IDL; messages travel as the bytes
that bags keep. Nothing is unpacked here, so that 1081 ranges cost a hundredth of a millisecond.
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
from slams.ros.messages import Record, store

MAX_UNREAD = 200  # messages of a topic that wait to be taken
END_PERIOD = 0.1  # [s] between looks at whether to end
MAX_BLOCKING = 0.1  # [s] that a writer may wait for slow readers, as in ROS
MAX_DOMAIN = 232  # beyond, DDS has no ports
LOOPBACK = """<CycloneDDS><Domain><General><Interfaces>
<NetworkInterface address="127.0.0.1" multicast="true"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32
</MaxAutoParticipantIndex><Peers><Peer address="localhost"/></Peers></Discovery>
</Domain></CycloneDDS>"""

types: Any = idl_types
_domains: dict[int, Any] = {}  # kept: a process configures a domain once


class Transport:
    """One participant of a DDS domain.

    Args:
        domain: its number, as ROS_DOMAIN_ID.
        localhost: speak to this machine only. CYCLONEDDS_URI, where it is set, decides instead.

    Raises:
        ValueError: no such domain, or DDS finds no network.
    """

    def __init__(self, domain: int = 0, localhost: bool = False) -> None:
        if not 0 <= domain <= MAX_DOMAIN:
            raise ValueError(f"domain: got {domain}, expected 0 to {MAX_DOMAIN}")
        try:
            if localhost and "CYCLONEDDS_URI" not in os.environ and domain not in _domains:
                _domains[domain] = Domain(domain, LOOPBACK)
            self._participant: Any = DomainParticipant(domain)
        except core.DDSException as error:
            raise ValueError(
                f"DDS cannot enter domain {domain} ({error}); is there a network, and does "
                "CYCLONEDDS_URI, where it is set, name one of its interfaces?"
            ) from error
        self._readers: dict[str, tuple[Any, str, Callback]] = {}
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._receive, name="dds", daemon=True)
        self._published: Any = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)

    def subscribe(self, topic: str, msgtype: str, quality: Quality, callback: Callback) -> None:
        """Have a callback called for every message of a topic; before `listen`."""
        qos = _qos(quality, MAX_UNREAD)  # of all its writers together
        reader = DataReader(self._participant, self._topic(topic, msgtype), qos)
        self._readers[topic] = (reader, msgtype, callback)

    def advertise(self, topic: str, msgtype: str, quality: Quality) -> Publisher:
        """Begin to publish a topic."""
        qos = _qos(quality, quality.value)
        writer = DataWriter(self._participant, self._topic(topic, msgtype), qos)
        return Publisher(writer, msgtype)

    def listen(self) -> None:
        """Begin to receive."""
        self._thread.start()

    def published(self, msgtype: str) -> list[str]:
        """Topics that have a publisher of a message type, in order."""
        alive, name = core.InstanceState.Alive, type_name(msgtype)
        found = [e for e in self._published.read(10_000) if e.type_name == name]
        topics = {e.topic_name for e in found if e.sample_info.instance_state == alive}
        return sorted(topic[2:] for topic in topics if topic.startswith("rt/"))

    def close(self) -> None:
        """Leave the domain; what was advertised is gone with it."""
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join()
        self._readers.clear()
        self._published = self._participant = None

    def _topic(self, topic: str, msgtype: str) -> Any:
        try:
            return Topic(self._participant, f"rt/{topic.lstrip('/')}", packed(msgtype))
        except core.DDSException as error:
            raise ValueError(f"{topic!r} is no name of a topic for DDS ({error})") from error

    def _receive(self) -> None:
        """Hand over messages as they come, until the end."""
        waiting, new = core.WaitSet(self._participant), core.SampleState.NotRead
        for reader, _, _ in self._readers.values():
            mask = core.ViewState.Any | core.InstanceState.Any | new
            waiting.attach(core.ReadCondition(reader, mask))
        while not self._ending.is_set():
            waiting.wait(duration(seconds=END_PERIOD))
            received = time.time_ns()
            for topic, (reader, msgtype, callback) in self._readers.items():
                for one in reader.take(MAX_UNREAD):
                    if hasattr(one, "cdr"):  # others say that a writer has left
                        callback(Record(topic, msgtype, received, one.cdr))


class Publisher:
    """One topic that is published."""

    def __init__(self, writer: Any, msgtype: str) -> None:
        self._writer, self._msgtype = writer, msgtype

    def publish(self, data: bytes) -> None:
        """Send a message.

        Raises:
            OSError: DDS does not take it.
        """
        try:
            self._writer.write(_of_bytes(packed(self._msgtype), data))
        except core.DDSException as error:
            raise OSError(f"DDS does not take a {self._msgtype}: {error}") from error

    @property
    def subscribers(self) -> int:
        """How many subscribe to it now."""
        return len(self._writer.get_matched_subscriptions())


def _qos(quality: Quality, depth: int) -> Any:
    reliable = core.Policy.Reliability.Reliable(duration(seconds=MAX_BLOCKING))
    best = core.Policy.Reliability.BestEffort
    stays, passes = core.Policy.Durability.TransientLocal, core.Policy.Durability.Volatile
    return core.Qos(
        best if quality is Quality.SENSOR else reliable,
        stays if quality is Quality.LATCHED else passes,
        core.Policy.History.KeepLast(depth),
        core.Policy.IgnoreLocal.Participant,
        core.Policy.DataRepresentation(use_cdrv0_representation=True),
    )


def type_name(msgtype: str) -> str:
    """The DDS name of a ROS message: "sensor_msgs::msg::dds_::LaserScan_"."""
    package, kind, name = msgtype.split("/")
    return f"{package}::{kind}::dds_::{name}_"


@cache
def packed(msgtype: str) -> Any:
    """The DDS type whose samples hold a message's bytes in `cdr`."""
    members = {name: _member(kind) for name, kind in store().fielddefs[msgtype][1]}
    name = msgtype.rpartition("/")[2]
    kind: Any = make_idl_struct(name, type_name(msgtype), members, dataclassify=False)
    kind.serialize = lambda self, **_: self.cdr
    kind.deserialize = classmethod(lambda cls, data, **_: _of_bytes(cls, data))
    kind.deserialize_key = classmethod(lambda *_, **__: None)  # of samples that are no messages
    return kind


def _of_bytes(kind: Any, data: bytes) -> Any:
    made = kind.__new__(kind)
    made.cdr = data
    return made


def _member(kind: Any) -> Any:
    """The DDS type of a field, of that in the library's words."""
    what = kind[1]
    if kind[0].name == "NAME":
        return packed(what)
    if kind[0].name == "BASE":
        plain = {"bool": bool, "string": str, "byte": types.uint8}
        return plain.get(what[0]) or getattr(types, what[0])
    of, length = _member(what[0]), what[1]
    if kind[0].name == "ARRAY":
        return types.array[of, length]
    return types.sequence[(of, *([length] if length else []))]
