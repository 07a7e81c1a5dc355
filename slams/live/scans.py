"""A robot's scans: from the messages of its lasers to ranges, in the order of their stamps."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from slams.formats.frames import bare
from slams.formats.sweep import Mounted, Sweep, common, same_directions, usable
from slams.ros.messages import READ, SCAN, Record, seconds, store
from slams.types import Laser

MAX_SILENCE = 2.0  # [s] without a scan of a laser; then no other laser's scan waits for one
COUNTS = ("dropped", "unreadable", "other_frame", "unplaced", "no_odometry", "sought")


class Arrived(NamedTuple):
    """A scan as its driver sent it, its stamp [ns], and when it came [s, monotonic]."""

    topic: str
    frame: str
    stamp: int
    sweep: Sweep
    at: float


class Scans:
    """Scans that wait, each topic's of one laser; given out by their stamps.

    A scan waits until every other laser has sent one that is as new; those of a single laser never
    do. `counts` says what became of all; the node counts those without odometry in time, and those
    before the place was known.

    Args:
        topics: of the lasers; of scans with one stamp the first topic's goes first.
        mounted: where the laser of a frame sits; None while that is not known.
        size: how many may wait; then the oldest is dropped.
        wait: for other lasers at most [s]; may be changed.
    """

    def __init__(
        self,
        topics: Sequence[str],
        mounted: Callable[[str], Mounted | None],
        size: int,
        wait: float,
    ) -> None:
        self.size, self.counts = size, dict.fromkeys(COUNTS, 0)
        self.came_at: dict[str, float] = {}  # [s] the last message, by topics as all of these
        self._topics, self._mounted = tuple(topics), mounted
        self.wait = wait
        self._waiting: list[Arrived] = []
        self._last: dict[str, Arrived] = {}
        self._places: dict[str, Mounted] = {}
        self._lasers: dict[str, tuple[list[Sweep], Laser]] = {}  # with their first two sweeps
        self.notes: list[str] = []  # what is assumed of the lasers, and which scans are left out
        self._changed = threading.Condition()

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, record: Record) -> None:
        """Take a message; never waits."""
        self.came_at[record.topic] = time.monotonic()
        try:
            scan = _arrived(record)
        except ValueError as error:
            self.leave_out(error)
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

    def first(self) -> Arrived | None:
        """The first scan, which stays; None if none came yet."""
        with self._changed:
            return self._waiting[0] if self._waiting else None

    def is_placed(self, topic: str) -> bool:
        """Whether it is known where the laser of a topic sits that has sent a scan."""
        if topic not in self._places:
            place = self._mounted(self._last[topic].frame)
            if place is not None:
                self._places[topic] = place
        return topic in self._places

    def take(self, timeout: float) -> Arrived | None:
        """The next scan of a laser whose place is known; None if no scan's turn comes in time."""
        with self._changed:
            return self._changed.wait_for(self._next, timeout)

    def laser(self, scan: Arrived) -> Laser:
        """The laser of a scan, the same object as long as the beams stay where they are."""
        sweeps, laser = self._lasers.get(scan.topic, ([], None))
        if sweeps and not same_directions(scan.sweep.geometry, sweeps[0].geometry):
            sweeps = []
        if laser is None or len(sweeps) < 2:  # with a second one the time between two is known
            sweeps = [*sweeps, scan.sweep]
            now = common(sweeps, self._places[scan.topic], self.notes).laser
            laser = laser if now == laser else now
        self._lasers[scan.topic] = sweeps, laser
        return laser

    def leave_out(self, error: ValueError) -> None:
        """Count and note a message that is no scan."""
        self.counts["unreadable"] += 1
        note = f"{error}; such scans are left out"
        if note not in self.notes:
            self.notes.append(note)

    def _next(self) -> Arrived | None:
        while self._waiting and not self.is_placed(self._waiting[0].topic):
            del self._waiting[0]
            self.counts["unplaced"] += 1
        if not self._waiting or self._has_to_wait(self._waiting[0], time.monotonic()):
            return None
        return self._waiting.pop(0)

    def _has_to_wait(self, scan: Arrived, now: float) -> bool:
        """Whether another laser has not come as far yet."""
        return now - scan.at < self.wait and any(
            last.sweep.t < scan.sweep.t
            for topic, last in self._last.items()
            if topic != scan.topic and now - last.at < MAX_SILENCE and self.is_placed(topic)
        )


def _arrived(record: Record) -> Arrived:
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
    sweep = Sweep(seconds(stamp), ranges, geometry)
    ns = stamp.sec * 10**9 + stamp.nanosec
    return Arrived(record.topic, bare(frame), ns, sweep, time.monotonic())
