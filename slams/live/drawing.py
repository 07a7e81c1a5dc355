"""Maps drawn while scans go on coming: what the algorithm is held for, and how it is kept short."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, TypeVar

from slams.live import snapshot
from slams.live.snapshot import Snapshot, sketch
from slams.types import OccupancyGrid, Slam

T = TypeVar("T")
Lock = AbstractContextManager[Any]

LONG = 0.005  # [s] that a scan may well be held for a map


class Drawer:
    """Draws maps of one algorithm that other threads update under a lock.

    The lock is held for the sketch, where the algorithm has one, else for the drawing; or, where
    that may be long, for a `Snapshot` of the process, where the system has such. How long it takes
    is not known before a copy of the process has tried it, and it may grow as the number of scans
    does. `held` [s] is for how long the lock was held last.
    """

    def __init__(self) -> None:
        self.held = 0.0
        self._spent = 0.0  # [s] of CPU: what else the machine does is no reason to draw otherwise
        self._in_place = math.inf  # of that, what each took last
        self._by_snapshot = 0.0 if snapshot.AT_HAND else math.inf
        self._at = 1  # scans, when that was

    def draw(self, slam: Slam, lock: Lock, scans: int) -> OccupancyGrid:
        """The map as it stands when the lock is taken, after so many scans."""
        expected = self._in_place * max(scans / self._at, 1.0)
        self._at = max(scans, 1)
        if expected > max(LONG, self._by_snapshot):
            try:
                return self._apart(slam, lock)
            except OSError:  # no room for another process: not tried again
                self._by_snapshot = math.inf
        draw = self._timed(lock, lambda: sketch(slam))
        self._in_place = self._spent
        return draw()

    def _apart(self, slam: Slam, lock: Lock) -> OccupancyGrid:
        taken = self._timed(lock, lambda: Snapshot(slam))
        self._by_snapshot = self._spent
        grid = taken.map()
        self._in_place = taken.seconds
        return grid

    def _timed(self, lock: Lock, work: Callable[[], T]) -> T:
        with lock:
            start, spent = time.perf_counter(), time.thread_time()
            done = work()
            self.held = time.perf_counter() - start
            self._spent = time.thread_time() - spent
        return done
