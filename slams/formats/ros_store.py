"""The standard ROS 2 messages as the bag library defines them: what messages are made of."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any


@cache
def store() -> Any:
    """Definitions, classes and CDR of the ROS 2 messages; the standard ones never changed."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


def prepare(msgtypes: Iterable[str]) -> None:
    """Have the code that packs and unpacks messages ready: 20 ms each, when they are first used."""
    for msgtype in msgtypes:
        store().get_msgdef(msgtype)


def fields(msgtype: str) -> list[tuple[str, tuple[str, Any]]]:
    """Names and types of a message's fields: "base", "name", "array" or "sequence", of what.

    Raises:
        LookupError: there is no such message.
    """
    if msgtype not in store().fielddefs:
        raise LookupError(f"{msgtype}: no standard ROS message")
    found: list[tuple[str, Any]] = store().fielddefs[msgtype][1]
    return [(name, _plain(kind)) for name, kind in found]


def _plain(kind: Any) -> tuple[str, Any]:
    """A field's type in words; the library has an enumeration of its own."""
    name, what = kind[0].name.lower(), kind[1]
    if name in ("array", "sequence"):
        return name, (_plain(what[0]), int(what[1]))
    return name, what if name == "name" else what[0]
