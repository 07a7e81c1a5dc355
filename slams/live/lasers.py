"""The robot's lasers: where each sits, and their scans in the order of their stamps."""

from __future__ import annotations

import time
from collections.abc import Sequence

from slams.formats.bag import Record
from slams.live.buffer import SensorBuffer
from slams.live.frames import Mounted
from slams.live.scan_order import Arrived, ScanOrder
from slams.live.scans import Received, ScanCleaner, ScanQueue, message_of
from slams.types import Laser, Ranges


class Lasers:
    """Scans from their messages to ranges and laser; each topic is one laser.

    Args:
        topics: of the scans.
        buffer: knows the frames.
        queue: where messages wait.
        wait: for an older scan of another laser [s].
        counts: where scans of other frames and of lasers without a place are counted.
    """

    def __init__(
        self,
        topics: Sequence[str],
        buffer: SensorBuffer,
        queue: ScanQueue,
        wait: float,
        counts: dict[str, int],
    ) -> None:
        self.order = ScanOrder(topics, wait)
        self._buffer, self._queue, self._counts = buffer, queue, counts
        self._cleaners: dict[str, ScanCleaner] = {}  # by topics, as these
        self._frames: dict[str, str] = {}
        self._scan_times: dict[str, float] = {}  # [s] when the last scan came

    def hear(self, record: Record) -> None:
        """Let a message wait; never waits itself."""
        self._scan_times[record.topic] = time.monotonic()
        self._queue.put(record)

    def last_scan(self, topic: str, otherwise: float) -> float:
        """When the last scan of a topic came [s], on this machine's clock."""
        return self._scan_times.get(topic, otherwise)

    def place(self, topic: str, mounted: Mounted) -> None:
        """Tell where the laser of a topic sits."""
        self._cleaners[topic] = ScanCleaner(mounted)

    def take(self, received: Received) -> None:
        """Put a scan in order, if it is one of a laser whose place is known.

        Raises:
            ValueError: it is no scan.
        """
        topic, message = received.record.topic, message_of(received.record)
        if message.frame != self._frames.setdefault(topic, message.frame):
            self._counts["other_frame"] += 1
        elif self._is_placed(topic):
            self.order.put(message, topic, received.at)
        else:
            self._counts["unplaced"] += 1

    def clean(self, scan: Arrived) -> tuple[Ranges, Laser]:
        """Ranges and laser of a scan; ValueError: no laser has such a geometry."""
        return self._cleaners[scan.topic].clean(scan.message)

    @property
    def notes(self) -> list[str]:
        """What is assumed of the lasers."""
        return [note for cleaner in self._cleaners.values() for note in cleaner.notes]

    def _is_placed(self, topic: str) -> bool:
        if topic not in self._cleaners:
            mounted = self._buffer.mounted(self._frames[topic])
            if mounted is not None:
                self.place(topic, mounted)
        return topic in self._cleaners
