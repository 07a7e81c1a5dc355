"""Salvages the undamaged messages of a bag: reads its records one by one, without an index."""

from __future__ import annotations

import mmap
import os
import shutil
import sqlite3
import struct
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any

from rosbags.rosbag1 import reader as rosbag1
from rosbags.rosbag2 import storage_mcap as mcap
from rosbags.typesys.msg import normalize_msgtype

from slams.formats.bag import Bag, merged_topics, write_ahead_log
from slams.formats.kind import MAGIC
from slams.ros.messages import READABLE_TYPES, Record

SCHEMA_OP, CHANNEL_OP, MESSAGE_OP, CHUNK_OP = 3, 4, 5, 6  # op codes of mcap
RECORD_HEAD = struct.Struct("<Bq")  # op code and length of an mcap record

TOPICS_QUERY = "SELECT id, name, type FROM topics"
MESSAGES_QUERY = "SELECT topic_id, timestamp, data FROM messages"
MAX_DATABASE_SIZE = 1 << 42  # bytes; a header with a larger size is broken

Channels = dict[int, tuple[str, str]]  # topic and type by number
RawMessages = Iterator[tuple[str, str, int, bytes]]  # topic, type, received [ns], data


def salvaged(path: Path, kind: str) -> Bag:
    """The messages that can still be read, and their topics."""
    topics, records = list[tuple[str, str, int]](), list[Record]()
    for topic, msgtype, received, data in _messages(path, kind):
        topics.append((topic, msgtype, 1))
        if msgtype in READABLE_TYPES:
            records.append(Record(topic, msgtype, received, data))
    records.sort(key=lambda record: record.received)
    kept = merged_topics(topics)
    return Bag(kept, kind == "bag", lambda names: (r for r in records if r.topic in names))


def _messages(path: Path, kind: str) -> RawMessages:
    if kind == "folder":
        for file in sorted(path.iterdir()):
            if file.suffix in (".mcap", ".db3"):
                yield from _messages(file, file.suffix[1:])
    elif kind == "db3":
        yield from _db3_messages(path)
    elif path.stat().st_size:  # an empty file cannot be mapped
        with path.open("rb") as stored:  # a mapped file limits reads of a broken, huge length
            data = mmap.mmap(stored.fileno(), 0, access=mmap.ACCESS_READ)
            data.seek(len(MAGIC[kind]))
            yield from _ros1_messages(data, {}) if kind == "bag" else _mcap_messages(data, {}, {})


def _db3_messages(path: Path) -> RawMessages:
    """Messages of a db3 up to the first page that is missing or broken."""
    with tempfile.TemporaryDirectory(prefix="slams-") as folder:
        copy = Path(folder) / "copy.db3"
        shutil.copyfile(path, copy)
        if (log := write_ahead_log(path)) is not None:
            shutil.copyfile(log, copy.with_name(f"{copy.name}-wal"))
        _restore_size(copy)
        database = sqlite3.connect(copy)
        try:
            topics = {key: names for key, *names in database.execute(TOPICS_QUERY)}
            for key, received, data in database.execute(MESSAGES_QUERY):
                if key in topics and isinstance(received, int) and isinstance(data, bytes):
                    name, msgtype = topics[key]
                    yield str(name), str(msgtype), received, data
        except (sqlite3.Error, OverflowError, UnicodeDecodeError):  # the last also in its messages
            return
        finally:
            database.close()


def _restore_size(database: Path) -> None:
    """Extend a database that is cut short to its full size, because sqlite requires it."""
    with database.open("rb") as file:
        page, pages = struct.unpack(">H10xI", file.read(32)[16:].ljust(16, b"\0"))
    size = (65536 if page == 1 else page) * pages
    if database.stat().st_size < size < MAX_DATABASE_SIZE:
        os.truncate(database, size)


def _ros1_messages(file: Any, connections: Channels) -> RawMessages:
    """Messages of ROS 1 records from the file's position on, also in chunks.

    A record is a header and data, each preceded by its length. After a broken header its data are
    parsed as a header, which fails, and reading continues at the next record.
    """
    while file.read(1):
        file.seek(-1, os.SEEK_CUR)
        with suppress(Exception):  # the library's parsers raise errors of any class
            header = rosbag1.Header.read(file)
            op = header.get_uint8("op")
            if op == rosbag1.RecordType.CHUNK:  # the beginning of a cut chunk may be readable
                unpack = rosbag1.decompressors[header.get_string("compression")]
                chunk = BytesIO(unpack(file.read(rosbag1.read_uint32(file))))
                yield from _ros1_messages(chunk, connections)
            elif op == rosbag1.RecordType.CONNECTION:
                msgtype = normalize_msgtype(rosbag1.Header.read(file).get_string("type"))
                connections[header.get_uint32("conn")] = header.get_string("topic"), msgtype
            else:
                data = rosbag1.read_bytes(file, rosbag1.read_uint32(file))
                if op == rosbag1.RecordType.MSGDATA:
                    number, received = header.get_uint32("conn"), header.get_time("time")
                    yield *connections[number], received, data


def _mcap_messages(file: Any, schemas: dict[int, str], channels: Channels) -> RawMessages:
    """Messages of mcap records (kind, length, content) from the file's position, also in chunks."""
    while len(head := file.read(RECORD_HEAD.size)) == RECORD_HEAD.size:
        op, size = RECORD_HEAD.unpack(head)
        content = file.read(size)
        record = BytesIO(content)
        with suppress(Exception):  # the library's parsers raise errors of any class
            if op == CHUNK_OP:  # the beginning of a cut chunk may be readable
                record.seek(28)  # after three numbers and a checksum
                unpack = mcap.DECOMPRESSORS[mcap.read_string(record)]
                (length,) = mcap.deserialize_uint64(record.read(8))
                chunk = BytesIO(unpack(record.read(length), 0))
                yield from _mcap_messages(chunk, schemas, channels)
            elif len(content) < size:
                return
            elif op == SCHEMA_OP:
                (number,) = mcap.deserialize_uint16(record.read(2))
                schemas[number] = mcap.read_string(record)
            elif op == CHANNEL_OP:
                number, schema = struct.unpack("<HH", record.read(4))
                channels[number] = mcap.read_string(record), schemas.get(schema, "")
            elif op == MESSAGE_OP:
                number, _, received, _ = mcap.deserialize_hiqq(record.read(22))
                yield *channels[number], received, record.read()
