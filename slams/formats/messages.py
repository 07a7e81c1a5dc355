"""Messages of the standard ROS types as rows of numbers, topic by topic."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

import numpy as np

from slams.formats.bag import Bag
from slams.formats.frames import Transforms, bare
from slams.formats.options import DamagedError
from slams.ros.attitude import ImuAttitude
from slams.ros.messages import PATH, READ, TFS, Inertial, Record, decoder, pose_of, seconds
from slams.scanlog import TimeSeries
from slams.types import Floats
from slams.validation import MAX_POSE_VALUE

ZSTD = b"\x28\xb5\x2f\xfd"


class Row(NamedTuple):
    """One message: when it was sent by its header, when received [s], whose frame it is of."""

    sent: float
    received: float
    frame: str
    values: Any


class Messages:
    """All that was taken from a bag: rows by topic, and the transforms.

    `bad` counts messages that cannot be read, where that is no error because one is `salvaging`.
    """

    def __init__(self, bag: Bag, salvaging: bool) -> None:
        self.rows: dict[str, list[Row]] = defaultdict(list)
        self.transforms = Transforms()
        self.bad = 0
        self._bag, self._salvaging = bag, salvaging

    def collect(self, types: Mapping[str, Collection[str]]) -> None:
        """Take the transforms, and the messages of topics, each of these types.

        Of a path's the last one counts.

        Raises:
            DamagedError: a message cannot be read.
        """
        types = dict(types) | {t.name: TFS for t in self._bag.topics if t.msgtype in TFS}
        paths: dict[str, Record] = {}
        for record in self._bag.records(types):
            if record.msgtype == PATH:  # each repeats the poses of those before
                paths[record.topic] = record
            elif record.msgtype in types[record.topic]:
                self._read(record)
        for record in paths.values():
            self._read(record)

    def _read(self, record: Record) -> None:
        ros1 = self._bag.ros1
        if record.data.startswith(ZSTD) and not ros1:  # no message begins like this
            raise ValueError(
                "its messages are compressed, which only the metadata.yaml beside it tells; give "
                "the folder of the bag"
            )
        try:
            message = decoder(ros1)(record.data, record.msgtype)
        except Exception as error:  # the library's parsers raise what they stumble over
            if not self._salvaging:
                what = f"a message of {record.topic} cannot be read; --salvage leaves it out"
                raise DamagedError(what) from error
            self.bad += 1
            return
        if record.msgtype in TFS:
            self.transforms.add(message, record.topic.endswith("static"))
            return
        received, rows = 1e-9 * record.received, self.rows[record.topic]
        if record.msgtype == PATH:  # of which each pose is a row
            for one in message.poses:
                rows.append(Row(seconds(one.header.stamp), received, "", pose_of(one.pose)))
        else:
            frame, values = READ[record.msgtype](message)
            rows.append(Row(seconds(message.header.stamp), received, frame, values))

    def frame(self, topic: str) -> str:
        """The frame that most messages of a topic name."""
        frames = Counter(row.frame for row in self.rows[topic])
        return bare(frames.most_common(1)[0][0]) if frames else ""

    def series(self, topic: str) -> tuple[Floats, list[Any]]:
        """Stamps (n,) [s] of a topic's messages, and what each says.

        Where no header has a stamp, the time of receiving stands in.
        """
        rows = self.rows[topic]
        sent = np.array([row.sent for row in rows], np.float64)
        stamps = sent if sent.any() else np.array([row.received for row in rows], np.float64)
        return stamps, [row.values for row in rows]

    def track(self, topic: str) -> TimeSeries | None:
        """Poses over time; what is not finite is left out."""
        stamps, rows = self.series(topic)
        values: Floats = np.array(rows, np.float64).reshape(-1, 3)
        whole = np.all(np.abs(values) < MAX_POSE_VALUE, axis=1)
        return TimeSeries(stamps[whole], values[whole]) if whole.any() else None


def tracks_of(
    t: Floats, rows: list[Inertial], turned: Floats | None
) -> tuple[TimeSeries | None, TimeSeries | None]:
    """Turn rate (n,), roll and pitch (k, 2) of all messages, stamped t; None: nothing measured."""
    imu = ImuAttitude(turned)
    stamped = [row._replace(sent=stamp) for stamp, row in zip(t.tolist(), rows, strict=True)]
    table = np.array([imu.push(row) for row in stamped]).reshape(-1, 4)
    known = np.abs(table) < MAX_POSE_VALUE  # nan is not
    rated, tilted = table[known[:, 1]], table[known[:, 2:].all(axis=1)]
    rate = TimeSeries(rated[:, 0].copy(), rated[:, 1].copy()) if len(rated) else None
    tilt = TimeSeries(tilted[:, 0].copy(), tilted[:, 2:].copy()) if len(tilted) else None
    return rate, tilt
