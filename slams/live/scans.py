"""Scans from messages: a queue of them, and their ranges cleaned as a log's are."""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from slams.formats.bag import SCAN, Record
from slams.formats.frames import bare
from slams.formats.ros_messages import READ
from slams.formats.ros_store import store
from slams.formats.sweep import Sweep, common, same_directions, usable
from slams.live.frames import Mounted
from slams.scanlog import ScanLog
from slams.types import Laser, Ranges


class Received(NamedTuple):
    """A message and when it came [s], on this machine's clock."""

    record: Record
    at: float


class ScanQueue:
    """First in, first out, at most `size`; when it is full the oldest scan is dropped.

    `came` counts all scans, `dropped` those left out.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self.came = self.dropped = 0
        self._scans: deque[Received] = deque()
        self._changed = threading.Condition()

    def put(self, record: Record) -> None:
        """Take a scan; never waits."""
        with self._changed:
            self.came += 1
            self._scans.append(Received(record, time.monotonic()))
            while len(self._scans) > self.size:
                self._scans.popleft()
                self.dropped += 1
            self._changed.notify()

    def take(self, timeout: float) -> Received | None:
        """The oldest scan; None if none comes in time [s]."""
        with self._changed:
            self._changed.wait_for(lambda: self._scans, timeout)
            return self._scans.popleft() if self._scans else None

    def peek(self, timeout: float) -> Received | None:
        """As `take`, but the scan stays."""
        with self._changed:
            self._changed.wait_for(lambda: self._scans, timeout)
            return self._scans[0] if self._scans else None

    def __len__(self) -> int:
        return len(self._scans)


class Message(NamedTuple):
    """A scan as its driver sent it; `stamp` [ns]."""

    stamp: int
    frame: str
    ranges: Ranges
    geometry: Laser

    @property
    def t(self) -> float:
        """The stamp [s], rounded as `slams.ros.stamps` does."""
        whole, rest = divmod(self.stamp, 10**9)
        return float(whole + 1e-9 * rest)


def message_of(record: Record) -> Message:
    """A sensor_msgs/LaserScan unpacked.

    Raises:
        ValueError: it is none, or has no beams or directions.
    """
    try:
        message = store().deserialize_cdr(record.data, SCAN)
    except Exception as error:  # the library's parsers raise what they stumble over
        raise ValueError(f"a message of {record.topic} is no {SCAN}") from error
    frame, (ranges, geometry) = READ[SCAN](message)
    if not usable(geometry):
        raise ValueError(f"a scan of {record.topic} has no beams or no directions")
    stamp = message.header.stamp
    return Message(stamp.sec * 10**9 + stamp.nanosec, bare(frame), ranges, geometry)


class ScanCleaner:
    """Gives every scan its laser, the same object as long as the beams stay where they are."""

    def __init__(self, mounted: Mounted) -> None:
        self.notes: list[str] = []
        self._mounted = mounted
        self._laser: Laser | None = None
        self._geometry: Laser | None = None
        self._first: Sweep | None = None

    def clean(self, message: Message) -> tuple[Ranges, Laser]:
        """Ranges (n,) [m], infinite and invalid as REP 117 has them, and the laser.

        Raises:
            ValueError: no laser has such a geometry.
        """
        sweep = Sweep(message.t, message.ranges, message.geometry)
        if self._geometry is None or not same_directions(sweep.geometry, self._geometry):
            self._geometry, self._laser, self._first = sweep.geometry, self._fan([sweep]), sweep
        elif self._first is not None:  # with a second scan the time between two is known
            self._laser, self._first = self._fan([self._first, sweep]), None
        assert self._laser is not None
        one = ScanLog(np.array([sweep.t]), sweep.ranges[None], self._laser)
        return one.ranges[0], one.laser

    def _fan(self, sweeps: list[Sweep]) -> Laser:
        """The laser of sweeps of one geometry; an equal one stays the object it is."""
        _, mount, flipped, z = self._mounted
        laser = replace(common(sweeps, mount, flipped, self.notes)[2], mount_z=z)
        return self._laser if laser == self._laser and self._laser is not None else laser
