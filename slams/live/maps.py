"""Maps drawn and published at their own pace, in a thread of their own."""

from __future__ import annotations

import threading
from collections.abc import Callable

from slams.live.slam import LiveSlam
from slams.types import OccupancyGrid

MAX_HELD_SHARE = 0.05  # of the time that scans may wait for maps; slower maps come less often


class MapThread:
    """Draws a map every so often, if there was a scan since.

    Args:
        live: whose map.
        publish: takes stamp [ns] and map.
        every: time between two maps [s]; 0 for none.

    `drawn` counts maps, `longest` is for how long [s] scans waited for one at most, `failed` why
    the last one could not be drawn or published.
    """

    def __init__(
        self, live: LiveSlam, publish: Callable[[int, OccupancyGrid], None], every: float
    ) -> None:
        self._live, self._publish, self._every = live, publish, every
        self._stamp = self._published = -1
        self.drawn, self.longest = 0, 0.0
        self.failed: Exception | None = None
        self._due = threading.Event()
        self._ending = False
        self._thread = threading.Thread(target=self._run, name="maps", daemon=True)
        if every:
            self._thread.start()

    def add(self, stamp: int) -> None:
        """Note that a scan with a stamp [ns] is in the map; the first map is drawn at once."""
        is_first = self._stamp < 0
        self._stamp = stamp
        if is_first:
            self._due.set()

    def close(self) -> None:
        """Publish the last map and end."""
        self._ending = True
        self._due.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        self._due.wait()
        while not self._ending:
            self._due.clear()
            self._draw()
            self._due.wait(max(self._every, self._live.held / MAX_HELD_SHARE))
        self._draw()

    def _draw(self) -> None:
        stamp = self._stamp
        if stamp < 0 or stamp == self._published:
            return
        try:
            self._publish(stamp, self._live.map())
        except Exception as error:  # the node reports it: scans go on
            self.failed = error
        self._published = stamp
        self.drawn += 1
        self.longest = max(self.longest, self._live.held)
