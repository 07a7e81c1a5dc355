"""ROS 1 and ROS 2 bags of any storage, read by the rosbags library: topics and raw messages."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from slams.formats.options import DamagedError
from slams.ros.messages import READABLE_TYPES, Record

REPAIR_HINTS = {
    "bag": "'rosbag reindex FILE' repairs it",
    "mcap": "'mcap recover FILE -o NEW.mcap' repairs it",
    "db3": "'sqlite3 FILE .recover | sqlite3 NEW.db3' repairs it",
    "folder": "'ros2 bag reindex FOLDER' writes its metadata again",
}


class Topic(NamedTuple):
    """A topic with its message type and number of messages."""

    name: str
    msgtype: str
    messages: int


class Bag(NamedTuple):
    """A recording: topics, and a function that gives messages of some in the order received."""

    topics: list[Topic]
    ros1: bool
    records: Callable[[Collection[str]], Iterator[Record]]


@contextmanager
def open_bag(path: Path, kind: str) -> Iterator[Bag]:
    """A complete bag, read by the library.

    Raises:
        DamagedError: the library cannot read the bag, or would miss its last messages.
    """
    if kind == "db3" and (log := write_ahead_log(path)) is not None:
        raise damaged_error(path, kind, f"its last messages are still in {log.name}")
    if kind in ("mcap", "db3") and path.suffix != f".{kind}":  # the library depends on the suffix
        raise ValueError(f"{path}: is a .{kind} by its content; give it this ending")
    from rosbags import rosbag1, rosbag2

    with _library_errors(path, kind):
        reader: Any = rosbag1.Reader(path) if kind == "bag" else rosbag2.Reader(path)
        reader.open()
    topics = merged_topics((c.topic, c.msgtype, c.msgcount) for c in reader.connections)

    def _records(names: Collection[str]) -> Iterator[Record]:
        connections, types = reader.connections, READABLE_TYPES
        wanted = [c for c in connections if c.topic in names and c.msgtype in types]
        with _library_errors(path, kind):
            for connection, received, data in reader.messages(wanted) if wanted else ():
                if connection in wanted:  # a damaged index also yields other messages
                    yield Record(connection.topic, connection.msgtype, received, data)

    try:
        yield Bag(topics, kind == "bag", _records)
    finally:
        with _library_errors(path, kind):
            reader.close()


@contextmanager
def _library_errors(path: Path, kind: str) -> Iterator[None]:
    """Turns errors of the library on a damaged file into one sentence."""
    try:
        yield
    except Exception as error:  # the library's parsers raise errors of any class
        if isinstance(error, FileNotFoundError | PermissionError) and error.errno:
            raise
        text = (str(error) or type(error).__name__).replace(str(path), path.name)
        raise damaged_error(path, kind, text) from error


def write_ahead_log(database: Path) -> Path | None:
    """The write-ahead log with messages that a killed recorder did not move to its database."""
    log = database.with_name(f"{database.name}-wal")
    return log if log.is_file() and log.stat().st_size else None


def joined_bags(bags: Sequence[Bag]) -> Bag:
    """The files of one recording as one bag.

    Raises:
        ValueError: some are of ROS 1 and some of ROS 2.
    """
    if len({bag.ros1 for bag in bags}) > 1:
        raise ValueError("some of the files are of ROS 1, the others of ROS 2")

    def _records(names: Collection[str]) -> Iterator[Record]:
        each = (bag.records(names) for bag in bags)
        return heapq.merge(*each, key=lambda record: record.received)

    return Bag(merged_topics(topic for bag in bags for topic in bag.topics), bags[0].ros1, _records)


def merged_topics(topics: Iterable[tuple[str, str, int]]) -> list[Topic]:
    """Each pair of topic and message type once, with the sum of its messages."""
    counts: Counter[tuple[str, str]] = Counter()
    for name, msgtype, messages in topics:
        counts[name, msgtype] += messages
    return [Topic(*key, n) for key, n in counts.items()]


def damaged_error(path: Path, kind: str, reason: str) -> DamagedError:
    """The error for an incomplete bag, with the command that repairs it."""
    damage = f"cut short or damaged ({' '.join(reason.split())[:120].rstrip('.')})"
    hint = f"{REPAIR_HINTS[kind]}, --salvage reads the undamaged part"
    return DamagedError(f"{path}: {damage}; {hint}")
