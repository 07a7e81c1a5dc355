"""What is whole in a bag that is not: its records read one by one, without index and summary."""

from __future__ import annotations

import bz2
import mmap
import os
import re
import shutil
import sqlite3
import struct
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

import lz4.frame

from slams.formats.bag import KNOWN, Record, Topic, write_ahead

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

HEADER1 = len(b"#ROSBAG V2.0\n")
HEADER2 = len(b"\x89MCAP0\r\n")
MESSAGE1, CHUNK1, CONNECTION1 = 2, 5, 7  # op codes of ROS 1 bags
SCHEMA2, CHANNEL2, MESSAGE2, CHUNK2 = 3, 4, 5, 6  # and of mcap
UNPACKERS: dict[bytes, Callable[[], Any]] = {
    b"bz2": bz2.BZ2Decompressor,
    b"lz4": lz4.frame.LZ4FrameDecompressor,
    b"zstd": zstd.ZstdDecompressor,
}
UNPACK_ERRORS = (OSError, EOFError, ValueError, RuntimeError, zstd.ZstdError)

TOPICS = "SELECT id, name, type FROM topics"
ROWS = "SELECT topic_id, timestamp, data FROM messages"
MAX_DATABASE_SIZE = 1 << 42  # bytes, a database this large is a broken number

Found = Iterator[tuple[str, str, int, bytes]]  # topic, type, received [ns], data
Bytes = bytes | mmap.mmap


class SalvagedBag:
    """The messages that can still be read, with the topics they are of."""

    def __init__(self, path: Path, kind: str) -> None:
        self.ros1 = kind == "bag"
        self._records: list[Record] = []
        counts: Counter[tuple[str, str]] = Counter()
        for topic, name, received, data in _found(path, kind):
            msgtype = name if "/msg/" in name else name.replace("/", "/msg/", 1)
            self.ros1 |= msgtype != name  # ROS 1 messages in an mcap
            counts[topic, msgtype] += 1
            if msgtype in KNOWN:
                self._records.append(Record(topic, msgtype, received, data))
        self._records.sort(key=lambda record: record.received)
        self.topics = [Topic(*key, n) for key, n in counts.items()]

    def records(self, topics: Collection[str]) -> Iterator[Record]:
        """Messages of these topics."""
        return (record for record in self._records if record.topic in topics)


def _found(path: Path, kind: str) -> Found:
    if kind == "folder":
        for file in _files(path):
            yield from _found(file, file.suffix[1:])
    elif kind == "db3":
        yield from _rows(path)
    elif path.stat().st_size:  # an empty file cannot be mapped
        with path.open("rb") as stored:
            data = mmap.mmap(stored.fileno(), 0, access=mmap.ACCESS_READ)
            start, reader = (HEADER1, _Ros1()) if kind == "bag" else (HEADER2, _Mcap())
            yield from reader.messages(data, start)


def _files(folder: Path) -> list[Path]:
    """Storage files of a ROS 2 bag, name_2 before name_10."""
    files = [path for path in folder.iterdir() if path.suffix in (".mcap", ".db3")]
    return sorted(files, key=lambda p: [int(n) for n in re.findall(r"\d+", p.stem)][-1:])


def _rows(path: Path) -> Found:
    """Rows of a db3 until the first page that is missing or broken."""
    with tempfile.TemporaryDirectory(prefix="slams-") as folder:
        copy = Path(folder) / "copy.db3"
        shutil.copyfile(path, copy)
        if (log := write_ahead(path)) is not None:
            shutil.copyfile(log, copy.with_name(f"{copy.name}-wal"))
        _pad(copy)
        database = sqlite3.connect(copy)
        try:
            topics = {key: names for key, *names in database.execute(TOPICS)}
            for key, received, data in database.execute(ROWS):
                if key in topics and isinstance(received, int) and isinstance(data, bytes):
                    name, msgtype = topics[key]
                    yield str(name), str(msgtype), received, data
        except (sqlite3.Error, OverflowError, UnicodeDecodeError):  # also in its own sentences
            return
        finally:
            database.close()


def _pad(database: Path) -> None:
    """Bring a database that is cut short to its old size: sqlite opens no other."""
    with database.open("rb") as file:
        page, pages = struct.unpack(">H10xI", file.read(32)[16:].ljust(16, b"\0"))
    size = (65536 if page == 1 else page) * pages
    if database.stat().st_size < size < MAX_DATABASE_SIZE:
        os.truncate(database, size)


class _Ros1:
    """Records of a ROS 1 bag: header fields, then data."""

    def __init__(self) -> None:
        self.connections: dict[bytes, tuple[str, str]] = {}

    def messages(self, data: Bytes, start: int = 0) -> Found:
        """All messages from a place on, those in chunks too."""
        for fields, content in _records1(data, start):
            op = fields.get(b"op", b"\0")[:1]
            if op == bytes([CHUNK1]):
                yield from self.messages(_unpacked(fields.get(b"compression", b""), content))
            elif op == bytes([CONNECTION1]):
                more = dict(_fields1(content))
                msgtype = more.get(b"type", b"").decode("latin-1")
                topic = fields.get(b"topic", b"").decode("latin-1")
                self.connections[fields.get(b"conn", b"")] = topic, msgtype
            elif op == bytes([MESSAGE1]) and fields.get(b"conn") in self.connections:
                when = fields.get(b"time", b"")
                if len(when) == 8:
                    seconds, nanoseconds = struct.unpack("<II", when)
                    topic, msgtype = self.connections[fields[b"conn"]]
                    yield topic, msgtype, seconds * 10**9 + nanoseconds, content


def _records1(data: Bytes, place: int) -> Iterator[tuple[dict[bytes, bytes], bytes]]:
    """Records until one is not whole; of the last one, a chunk, what is there."""
    while place + 4 <= len(data):
        header, place = _piece(data, place)
        if header is None or place + 4 > len(data):
            return
        fields = dict(_fields1(header))
        content, after = _piece(data, place)
        if content is None:  # cut short: of a chunk the beginning is still of use
            if fields.get(b"op") == bytes([CHUNK1]):
                yield fields, data[place + 4 :]
            return
        yield fields, content
        place = after


def _fields1(header: bytes) -> Iterator[tuple[bytes, bytes]]:
    """name=value fields of a header, each with its length before it."""
    place = 0
    while place + 4 <= len(header):
        field, place = _piece(header, place)
        if field is None:
            return
        name, equals, value = field.partition(b"=")
        if equals:
            yield name, value


def _piece(data: Bytes, place: int) -> tuple[bytes | None, int]:
    """Bytes with their length in front, None if not all are there, and the place behind them."""
    (size,) = struct.unpack_from("<I", data, place)
    end = place + 4 + size
    return (data[place + 4 : end] if end <= len(data) else None), end


class _Mcap:
    """Records of an mcap file: a byte of kind, eight of length, the content."""

    def __init__(self) -> None:
        self.schemas: dict[int, str] = {}
        self.channels: dict[int, tuple[str, str]] = {}

    def messages(self, data: Bytes, start: int = 0) -> Found:
        """All messages from a place on, those in chunks too."""
        for op, content in _records2(data, start):
            try:
                if op == CHUNK2:
                    yield from self.messages(_chunk2(content))
                elif op == MESSAGE2:
                    channel, _, received = struct.unpack_from("<HIQ", content)
                    if channel in self.channels:
                        yield (*self.channels[channel], received, content[22:])
                else:
                    self._take(op, content)
            except struct.error:
                continue

    def _take(self, op: int, content: bytes) -> None:
        """Remember a schema's or a channel's name."""
        if op == SCHEMA2:
            (number,) = struct.unpack_from("<H", content)
            self.schemas[number] = _text(content, 2)
        elif op == CHANNEL2:
            number, schema = struct.unpack_from("<HH", content)
            self.channels[number] = _text(content, 4), self.schemas.get(schema, "")


def _records2(data: Bytes, place: int) -> Iterator[tuple[int, bytes]]:
    """Records until one is not whole; of the last one, a chunk, what is there."""
    while place + 9 <= len(data):
        op, size = struct.unpack_from("<BQ", data, place)
        place += 9
        if place + size > len(data):
            if op == CHUNK2:
                yield op, data[place:]
            return
        yield op, data[place : place + size]
        place += size


def _chunk2(content: bytes) -> bytes:
    """The records of a chunk: three numbers and a checksum, the compression's name, the bytes."""
    name = _text(content, 28)
    return _unpacked(name.encode("latin-1"), content[28 + 4 + len(name) + 8 :])


def _text(content: bytes, place: int) -> str:
    text, _ = _piece(content, place)
    return (text or b"").decode("latin-1")


def _unpacked(compression: bytes, data: bytes) -> bytes:
    """As much of a chunk as unpacks."""
    if compression in (b"", b"none"):
        return data
    parts: list[bytes] = []
    if compression in UNPACKERS:
        unpacker = UNPACKERS[compression]()
        try:
            for start in range(0, len(data), 4096):
                parts.append(unpacker.decompress(data[start : start + 4096]))
        except UNPACK_ERRORS:
            pass
    return b"".join(parts)
