"""The scan queue: unpacks the messages of a robot's lasers and orders the scans by stamp."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from slams.formats import sweep as sweeping
from slams.formats.frames import without_slash
from slams.formats.sweep import LaserMount, Sweep, has_directions, resampled, same_directions
from slams.ros.messages import READERS, SCAN_TYPE, Record, seconds, typestore
from slams.types import Laser

SCAN_TIMEOUT = 2.0  # s without a scan of a laser; after that no scan of another laser waits for it
SCAN_COUNTERS = ("dropped", "unreadable", "other_frame", "unplaced", "no_odometry", "sought")


class ReceivedScan(NamedTuple):
    """A scan as its driver sent it, its stamp [ns], and when it was received [s, monotonic]."""

    topic: str
    frame: str
    stamp: int
    sweep: Sweep
    received: float


class ScanQueue:
    """Queue of received scans, one topic per laser, taken in the order of their stamps.

    A scan waits until every other laser has sent a scan that is as new; with one laser no scan
    waits. `counts` has the rejected scans; the node adds the scans without odometry in time, and
    those before the robot was localized.

    Args:
        topics: of the lasers; of scans with equal stamps the one on the earlier topic comes first.
        mount_of: gives the mount of the laser with a frame; None while it is unknown.
        size: maximum number of queued scans; beyond it the oldest is dropped.
        wait: maximum time that a scan waits for other lasers [s]; may be changed.
    """

    def __init__(
        self,
        topics: Sequence[str],
        mount_of: Callable[[str], LaserMount | None],
        size: int,
        wait: float,
    ) -> None:
        self.size, self.counts = size, dict.fromkeys(SCAN_COUNTERS, 0)
        self.received_at: dict[str, float] = {}  # s, of the last message, by topic
        self._topics, self._mount_of = tuple(topics), mount_of
        self.wait = wait
        self._waiting: list[ReceivedScan] = []
        self._last: dict[str, ReceivedScan] = {}
        self._mounts: dict[str, LaserMount] = {}
        self._lasers: dict[str, tuple[list[Sweep], Laser]] = {}  # with their first two sweeps
        self.notes: list[str] = []  # assumptions about the lasers, reasons for rejected scans
        self._changed = threading.Condition()

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, record: Record) -> None:
        """Unpack a message and queue its scan; never waits."""
        self.received_at[record.topic] = time.monotonic()
        try:
            scan = _received_scan(record)
        except ValueError as error:
            self.reject(error)
            return
        with self._changed:
            last = self._last.get(scan.topic, scan)
            if scan.frame != last.frame:
                self.counts["other_frame"] += 1
                return
            self._last[scan.topic] = scan
            self._waiting.append(scan)
            if len(self._topics) > 1:
                self._waiting.sort(key=lambda one: (one.sweep.t, self._topics.index(one.topic)))
            while len(self._waiting) > self.size:
                del self._waiting[0]
                self.counts["dropped"] += 1
            self._changed.notify()

    def first(self) -> ReceivedScan | None:
        """The first scan, which stays in the queue; None if the queue is empty."""
        with self._changed:
            return self._waiting[0] if self._waiting else None

    def has_mount(self, topic: str) -> bool:
        """Whether the mount of a laser that has sent a scan is known."""
        if topic not in self._mounts:
            mount = self._mount_of(self._last[topic].frame)
            if mount is not None:
                self._mounts[topic] = mount
        return topic in self._mounts

    def take(self, timeout: float) -> ReceivedScan | None:
        """The next scan of a laser with a known mount; None if none is ready within `timeout`."""
        with self._changed:
            return self._changed.wait_for(self._next, timeout)

    def laser(self, scan: ReceivedScan) -> Laser:
        """The laser of a scan, the same object until its directions or a guessed limit change."""
        sweeps, laser = self._lasers.get(scan.topic, ([], None))
        if sweeps and not same_directions(scan.sweep.geometry, sweeps[0].geometry):
            sweeps = []
        if laser is None or len(sweeps) < 2:  # two sweeps give the scan interval
            with self._changed:
                queued = [one.sweep for one in self._waiting if one.topic == scan.topic]
            later = [one for one in queued if same_directions(one.geometry, scan.sweep.geometry)]
            sweeps = [*sweeps, scan.sweep, *later][:2]
            found = resampled(sweeps, self._mounts[scan.topic], self.notes).laser
            laser = laser if found == laser else found
        _, reach = sweeping.range_limits(sweeps[0].geometry, scan.sweep.ranges, [])
        if reach > laser.range_max:
            laser = replace(laser, range_max=reach)
        self._lasers[scan.topic] = sweeps, laser
        return laser

    def reject(self, error: ValueError) -> None:
        """Count and note a message that has no valid scan."""
        self.counts["unreadable"] += 1
        note = f"{error}; such scans are left out"
        if note not in self.notes:
            self.notes.append(note)

    def _next(self) -> ReceivedScan | None:
        while self._waiting and not self.has_mount(self._waiting[0].topic):
            del self._waiting[0]
            self.counts["unplaced"] += 1
        if not self._waiting or self._waits_for_lasers(self._waiting[0], time.monotonic()):
            return None
        return self._waiting.pop(0)

    def _waits_for_lasers(self, scan: ReceivedScan, now: float) -> bool:
        """Whether another laser's latest scan is older than this scan."""
        return now - scan.received < self.wait and any(
            last.sweep.t < scan.sweep.t
            for topic, last in self._last.items()
            if topic != scan.topic and now - last.received < SCAN_TIMEOUT and self.has_mount(topic)
        )


def _received_scan(record: Record) -> ReceivedScan:
    """Unpack a sensor_msgs/LaserScan.

    Raises:
        ValueError: the message cannot be read, or has no beams or no directions.
    """
    try:
        message = typestore().deserialize_cdr(record.data, SCAN_TYPE)
    except Exception as error:  # the library's parsers raise errors of any class
        raise ValueError(f"a message of {record.topic} is no {SCAN_TYPE}") from error
    frame, (ranges, geometry) = READERS[SCAN_TYPE](message)
    if not has_directions(geometry):
        raise ValueError(f"a scan of {record.topic} has no beams or no directions")
    stamp = message.header.stamp
    sweep = Sweep(seconds(stamp), ranges, geometry)
    ns = stamp.sec * 10**9 + stamp.nanosec
    return ReceivedScan(record.topic, without_slash(frame), ns, sweep, time.monotonic())
