"""The messages of a bag as rows of numbers by topic, and its transforms."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

import numpy as np

from slams.formats.bag import Bag
from slams.formats.frames import Transforms, without_slash
from slams.formats.kind import ZSTD_MAGIC
from slams.formats.options import DamagedError
from slams.ros import messages as ros
from slams.ros.attitude import ImuAttitude
from slams.scanlog import TimeSeries
from slams.types import Floats
from slams.validation import MAX_POSE_VALUE


class Row(NamedTuple):
    """One message: stamp of its header and time of receiving [s], frame, values."""

    stamp: float
    received: float
    frame: str
    values: Any


class Messages:
    """The messages that were read from a bag: rows by topic, and the transforms.

    When `salvage` is set, messages that cannot be read are counted in `n_unreadable`.
    """

    def __init__(self, bag: Bag, salvage: bool) -> None:
        self.rows: dict[str, list[Row]] = defaultdict(list)
        self.transforms = Transforms()
        self.n_unreadable = 0
        self._bag, self._salvage = bag, salvage

    def collect(self, types: Mapping[str, Collection[str]]) -> None:
        """Read the transforms, and the messages of topics with the given types.

        Of the paths on a topic only the last is read. Transforms come from the scans' namespaces,
        if there are any, as each of several robots has its own.

        Raises:
            DamagedError: a message cannot be read.
        """
        tf_topics = [topic.name for topic in self._bag.topics if topic.msgtype in ros.TF_TYPES]
        scans = [name for name, kinds in types.items() if kinds == ros.SCAN_TYPES]
        spaces = {name: name[: name.rfind("/") + 1] for name in tf_topics}
        own = [name for name in tf_topics if any(scan.startswith(spaces[name]) for scan in scans)]
        types = dict(types) | dict.fromkeys(own or tf_topics, ros.TF_TYPES)
        paths: dict[str, ros.Record] = {}
        for record in self._bag.records(types):
            if record.msgtype == ros.PATH_TYPE:  # each path repeats the poses of earlier ones
                paths[record.topic] = record
            elif record.msgtype in types[record.topic]:
                self._read(record)
        for record in paths.values():
            self._read(record)

    def _read(self, record: ros.Record) -> None:
        ros1 = self._bag.ros1
        if record.data.startswith(ZSTD_MAGIC) and not ros1:  # no message begins like this
            raise ValueError("its messages are compressed by zstd; give the folder of the bag")
        try:
            message = ros.decoder(ros1)(record.data, record.msgtype)
        except Exception as error:  # the library's parsers raise errors of any class
            if not self._salvage:
                text = f"a message of {record.topic} cannot be read; --salvage leaves it out"
                raise DamagedError(text) from error
            self.n_unreadable += 1
            return
        if record.msgtype in ros.TF_TYPES:
            self.transforms.add(message, record.topic.endswith("static"))
            return
        received, rows = 1e-9 * record.received, self.rows[record.topic]
        if record.msgtype == ros.PATH_TYPE:  # each of its poses becomes a row
            for item in message.poses:
                stamp = ros.seconds(item.header.stamp)
                rows.append(Row(stamp, received, "", ros.planar_pose(item.pose)))
        else:
            frame, values = ros.READERS[record.msgtype](message)
            rows.append(Row(ros.seconds(message.header.stamp), received, frame, values))

    def frame(self, topic: str) -> str:
        """The most frequent frame of a topic's messages."""
        frames = Counter(row.frame for row in self.rows[topic])
        return without_slash(frames.most_common(1)[0][0]) if frames else ""

    def series(self, topic: str) -> tuple[Floats, list[Any]]:
        """Stamps (n,) [s] and values of a topic's messages.

        If no header has a stamp, the times of receiving are used.
        """
        rows = self.rows[topic]
        stamps = np.array([row.stamp for row in rows], np.float64)
        received = np.array([row.received for row in rows], np.float64)
        return stamps if stamps.any() else received, [row.values for row in rows]

    def poses(self, topic: str) -> TimeSeries | None:
        """Poses over time; poses that are not finite are left out."""
        stamps, rows = self.series(topic)
        values: Floats = np.array(rows, np.float64).reshape(-1, 3)
        valid = np.all(np.abs(values) < MAX_POSE_VALUE, axis=1)
        return TimeSeries(stamps[valid], values[valid]) if valid.any() else None


def imu_series(
    t: Floats, rows: list[ros.ImuReading], rotation: Floats | None
) -> tuple[TimeSeries | None, TimeSeries | None]:
    """Yaw rate (n,), roll and pitch (k, 2) of all readings with stamps t; None: not measured."""
    imu = ImuAttitude(rotation)
    stamped = [row._replace(stamp=stamp) for stamp, row in zip(t.tolist(), rows, strict=True)]
    table = np.array([imu.push(row) for row in stamped]).reshape(-1, 4)
    valid = np.abs(table) < MAX_POSE_VALUE  # False for nan
    rates, tilts = table[valid[:, 1]], table[valid[:, 2:].all(axis=1)]
    rate = TimeSeries(rates[:, 0].copy(), rates[:, 1].copy()) if len(rates) else None
    attitude = TimeSeries(tilts[:, 0].copy(), tilts[:, 2:].copy()) if len(tilts) else None
    return rate, attitude
