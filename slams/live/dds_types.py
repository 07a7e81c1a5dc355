"""ROS 2 messages as DDS has them: the library's definitions, named and laid out as ROS's IDL.

Messages travel as the bytes that bags keep; nothing is unpacked here, so that 1081 ranges cost a
hundredth of a millisecond.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from cyclonedds.idl import make_idl_struct
from cyclonedds.idl import types as idl_types

from slams.formats.ros_store import fields

types: Any = idl_types


def type_name(msgtype: str) -> str:
    """The DDS name of a ROS message: "sensor_msgs::msg::dds_::LaserScan_"."""
    package, kind, name = msgtype.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_name(dds_name: str) -> str:
    """The ROS name of a DDS type; what is none stays as it is."""
    package, _, rest = dds_name.partition("::")
    kind, _, name = rest.partition("::dds_::")
    return f"{package}/{kind}/{name.removesuffix('_')}" if name else dds_name


def topic_name(topic: str) -> str:
    """The DDS name of a ROS topic."""
    return f"rt/{topic.lstrip('/')}"


@cache
def packed(msgtype: str) -> Any:
    """The DDS type whose samples hold a message's bytes in `cdr`."""
    members = {name: _member(kind, what) for name, (kind, what) in fields(msgtype)}
    name = msgtype.rpartition("/")[2]
    kind: Any = make_idl_struct(name, type_name(msgtype), members, dataclassify=False)
    kind.serialize = lambda self, **_: self.cdr
    kind.deserialize = classmethod(lambda cls, data, **_: _of_bytes(cls, data))
    kind.deserialize_key = classmethod(lambda *_, **__: None)  # of samples that are no messages
    return kind


def sample(msgtype: str, data: bytes) -> Any:
    """A message's bytes as a sample of its type."""
    return _of_bytes(packed(msgtype), data)


def _of_bytes(kind: Any, data: bytes) -> Any:
    made = kind.__new__(kind)
    made.cdr = data
    return made


def _member(kind: str, what: Any) -> Any:
    if kind == "name":
        return packed(what)
    if kind == "base":
        plain = {"bool": bool, "string": str, "byte": types.uint8}
        return plain.get(what) or getattr(types, what)
    (inner, of), length = what
    if kind == "array":
        return types.array[_member(inner, of), length]
    return types.sequence[(_member(inner, of), *([length] if length else []))]
