"""Scans that wait for the algorithm: a bounded number, of which the newest win."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import NamedTuple

from slams.formats.bag import Record


class Waiting(NamedTuple):
    """A scan as it came, and when [s], on this machine's clock."""

    record: Record
    since: float


class Inbox:
    """First in, first out; when it is full the oldest is left out and counted.

    `came` counts all scans, `dropped` those left out, `heard` [s] is when the last one came.
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self.came = self.dropped = 0
        self.heard: float | None = None
        self._scans: deque[Waiting] = deque()
        self._changed = threading.Condition()

    def put(self, record: Record) -> None:
        """Take a scan; never waits."""
        with self._changed:
            self.heard = time.monotonic()
            self.came += 1
            self._scans.append(Waiting(record, self.heard))
            while len(self._scans) > self.most:
                self._scans.popleft()
                self.dropped += 1
            self._changed.notify()

    def take(self, timeout: float) -> Waiting | None:
        """The oldest scan that waits; None if none comes in time [s]."""
        with self._changed:
            self._changed.wait_for(lambda: self._scans, timeout)
            return self._scans.popleft() if self._scans else None

    def first(self, timeout: float) -> Waiting | None:
        """As `take`, but the scan stays."""
        with self._changed:
            self._changed.wait_for(lambda: self._scans, timeout)
            return self._scans[0] if self._scans else None

    def __len__(self) -> int:
        return len(self._scans)
