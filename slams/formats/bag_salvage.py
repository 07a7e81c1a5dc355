"""What is whole in a bag that is not: its records read one by one, without index and summary."""

from __future__ import annotations

import bz2
import mmap
import os
import shutil
import sqlite3
import struct
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import lz4.frame

from slams.formats.bag import KNOWN, Bag, Record, summed, write_ahead

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

HEADER1 = len(b"#ROSBAG V2.0\n")
HEADER2 = len(b"\x89MCAP0\r\n")
MESSAGE1, CHUNK1, CONNECTION1 = b"\x02", b"\x05", b"\x07"  # op codes of ROS 1 bags
SCHEMA2, CHANNEL2, MESSAGE2, CHUNK2 = 3, 4, 5, 6  # and of mcap
RECORD2 = struct.Struct("<BQ")  # op code and length of an mcap record
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


def salvaged(path: Path, kind: str) -> Bag:
    """The messages that can still be read, with the topics they are of."""
    ros1, records = kind == "bag", list[Record]()
    found: list[tuple[str, str, int]] = []
    for topic, name, received, data in _found(path, kind):
        msgtype = name if "/msg/" in name else name.replace("/", "/msg/", 1)
        ros1 |= msgtype != name  # ROS 1 messages in an mcap
        found.append((topic, msgtype, 1))
        if msgtype in KNOWN:
            records.append(Record(topic, msgtype, received, data))
    records.sort(key=lambda record: record.received)
    return Bag(summed(found), ros1, lambda names: (r for r in records if r.topic in names))


def _found(path: Path, kind: str) -> Found:
    if kind == "folder":
        for file in sorted(path.iterdir()):
            if file.suffix in (".mcap", ".db3"):
                yield from _found(file, file.suffix[1:])
    elif kind == "db3":
        yield from _rows(path)
    elif path.stat().st_size:  # an empty file cannot be mapped
        with path.open("rb") as stored:
            data = mmap.mmap(stored.fileno(), 0, access=mmap.ACCESS_READ)
            yield from _ros1(data, HEADER1, {}) if kind == "bag" else _mcap(data, HEADER2, {}, {})


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


def _ros1(data: Bytes, place: int, connections: dict[bytes, tuple[str, str]]) -> Found:
    """Messages of ROS 1 records (header fields, then data) from a place on, in chunks too."""
    while place < len(data):
        header, place = _piece(data, place)
        content, place = _piece(data, place)
        fields = _fields1(header)
        op, number = fields.get(b"op", b""), fields.get(b"conn", b"")
        if op == CHUNK1:  # cut short, its beginning is still of use
            unpacked = _unpacked(fields.get(b"compression", b""), content)
            yield from _ros1(unpacked, 0, connections)
        elif place > len(data):
            return
        elif op == CONNECTION1:
            topic, msgtype = fields.get(b"topic", b""), _fields1(content).get(b"type", b"")
            connections[number] = topic.decode("latin-1"), msgtype.decode("latin-1")
        elif op == MESSAGE1 and number in connections and len(fields.get(b"time", b"")) == 8:
            seconds, nanoseconds = struct.unpack("<II", fields[b"time"])
            yield *connections[number], seconds * 10**9 + nanoseconds, content


def _fields1(header: bytes) -> dict[bytes, bytes]:
    """name=value fields of a header, each with its length before it."""
    fields, place = {}, 0
    while place < len(header):
        field, place = _piece(header, place)
        name, equals, value = field.partition(b"=")
        if equals and place <= len(header):
            fields[name] = value
    return fields


def _piece(data: Bytes, place: int) -> tuple[bytes, int]:
    """Bytes with their length in front, as many as are there, and the place behind them all."""
    start = place + 4
    end = start + int.from_bytes(data[place:start], "little")
    return data[start:end], end


def _mcap(
    data: Bytes, place: int, schemas: dict[int, str], channels: dict[int, tuple[str, str]]
) -> Found:
    """Messages of mcap records (kind, length, content) from a place on, in chunks too."""
    while place + RECORD2.size <= len(data):
        op, size = RECORD2.unpack_from(data, place)
        start, place = place + RECORD2.size, place + RECORD2.size + size
        content = data[start:place]
        if op != CHUNK2 and place > len(data):
            return
        with suppress(struct.error):  # a record too short for its kind
            if op == CHUNK2:  # cut short, its beginning is still of use
                yield from _mcap(_chunk2(content), 0, schemas, channels)
            elif op == SCHEMA2:
                (number,) = struct.unpack_from("<H", content)
                schemas[number] = _text(content, 2)
            elif op == CHANNEL2:
                number, schema = struct.unpack_from("<HH", content)
                channels[number] = _text(content, 4), schemas.get(schema, "")
            elif op == MESSAGE2:
                number, _, received = struct.unpack_from("<HIQ", content)
                if number in channels:
                    yield *channels[number], received, content[22:]


def _chunk2(content: bytes) -> bytes:
    """The records of a chunk: three numbers and a checksum, the compression's name, the bytes."""
    name = _text(content, 28)
    return _unpacked(name.encode("latin-1"), content[28 + 4 + len(name) + 8 :])


def _text(content: bytes, place: int) -> str:
    text, end = _piece(content, place)
    return text.decode("latin-1") if end <= len(content) else ""


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
