"""Maps drawn while scans go on coming: what the algorithm is held for, and how it is kept short."""

from __future__ import annotations

import copy
import gc
import threading
import time
from collections.abc import Callable
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np

from slams.types import OccupancyGrid, Slam

T = TypeVar("T")

LONG = 0.005  # [s] that a scan may well be held for a map
PER_OBJECT, PER_BYTE = 5e-6, 1e-9  # [s] that a copy takes, at least, on machines we measured
LONGEST_COPY = 0.03  # [s] by these; a larger one takes memory from the system, many times as long
SHARED = (type, FunctionType, BuiltinFunctionType, ModuleType)  # what a copy leaves as it is
NO_COPY = (TypeError, AttributeError, NotImplementedError, copy.Error)  # of what cannot be copied


@runtime_checkable
class Sketched(Protocol):
    """An algorithm that can say quickly what its map is to be drawn from."""

    def sketch(self) -> Callable[[], OccupancyGrid]:
        """What draws the map as it stands now, in any thread, while updates go on."""
        ...


class Drawer:
    """Draws maps of one algorithm that other threads update under a lock.

    The lock is held for the sketch, where the algorithm has one; else for the drawing; or, where
    that is long and a copy is quicker, for a copy that is drawn afterwards. `held` [s] is for how
    long the lock was held last.
    """

    def __init__(self) -> None:
        self.held = 0.0
        self._in_place, self._by_copy = 0.0, 0.0  # what they took last

    def draw(self, slam: Slam, lock: threading.RLock) -> OccupancyGrid:
        """The map as it stands when the lock is taken."""
        if isinstance(slam, Sketched):
            return self._timed(lock, slam.sketch)()
        if self._in_place > max(LONG, self._by_copy):
            copied = self._timed(lock, lambda: self._copy(slam))
            if copied is not None:
                self._by_copy = self.held
                return copied.map()
        grid = self._timed(lock, slam.map)
        self._in_place = self.held
        return grid

    def _copy(self, slam: Slam) -> Slam | None:
        """A copy, if that takes less time than drawing did."""
        if not copies_within(slam, min(self._in_place, LONGEST_COPY)):
            return None
        try:
            return copy.deepcopy(slam)
        except NO_COPY:
            return None

    def _timed(self, lock: threading.RLock, work: Callable[[], T]) -> T:
        with lock:
            start = time.perf_counter()
            done = work()
            self.held = time.perf_counter() - start
        return done


def copies_within(thing: Any, seconds: float) -> bool:
    """Whether a deep copy can take so little time, by the number and size of what hangs on it.

    A copy tried in vain would hold scans for as long as it takes: gmapping's of 165 MB takes
    0.3 s. Looking takes a tenth of `seconds` at most.
    """
    seen: set[int] = set()
    waiting, spent = [thing], 0.0
    while waiting:
        one = waiting.pop()
        if id(one) in seen or isinstance(one, SHARED):
            continue
        seen.add(id(one))
        spent += PER_OBJECT + PER_BYTE * (one.nbytes if isinstance(one, np.ndarray) else 0)
        if spent > seconds:
            return False
        waiting += gc.get_referents(one)
    return True
