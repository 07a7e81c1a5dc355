"""Maps drawn while scans go on coming: what the algorithm is held for, and how it is kept short."""

from __future__ import annotations

import copy
import math
import threading
import time
from collections.abc import Callable
from typing import Protocol, TypeVar, runtime_checkable

from slams.types import OccupancyGrid, Slam

T = TypeVar("T")

NO_COPY = (TypeError, AttributeError, NotImplementedError, copy.Error)  # of what cannot be copied


@runtime_checkable
class Sketched(Protocol):
    """An algorithm that can say quickly what its map is to be drawn from."""

    def sketch(self) -> Callable[[], OccupancyGrid]:
        """What draws the map as it stands now, in any thread, while updates go on."""
        ...


class Drawer:
    """Draws maps of one algorithm that other threads update under a lock.

    The lock is held for the sketch, where the algorithm has one; else for the drawing or for a copy
    that is drawn afterwards, whichever took less time when it was done last. `held` [s] is for how
    long the lock was held last.
    """

    def __init__(self) -> None:
        self.held = 0.0
        self._by_copy, self._in_place = 0.0, 0.0

    def draw(self, slam: Slam, lock: threading.RLock) -> OccupancyGrid:
        """The map as it stands when the lock is taken."""
        if isinstance(slam, Sketched):
            return self._timed(lock, slam.sketch)()
        if self._in_place <= self._by_copy:
            grid = self._timed(lock, slam.map)
            self._in_place = self.held
            return grid
        try:
            copied = self._timed(lock, lambda: copy.deepcopy(slam))
        except NO_COPY:
            self._by_copy = math.inf
            return self.draw(slam, lock)
        self._by_copy = self.held
        return copied.map()

    def _timed(self, lock: threading.RLock, work: Callable[[], T]) -> T:
        with lock:
            start = time.perf_counter()
            done = work()
            self.held = time.perf_counter() - start
        return done
