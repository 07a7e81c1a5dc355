"""The map, drawn and published at its own pace, in a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Callable

from slams.live.slam import LiveSlam
from slams.types import OccupancyGrid

SHARE = 0.05  # of the time that scans may be held for maps; slower maps come less often

Show = Callable[[int, OccupancyGrid], None]


class MapThread:
    """Draws a map every so often, if there was a scan since.

    Args:
        live: whose map.
        show: takes stamp [ns] and map.
        every: time between two maps [s]; 0 for none.
    """

    def __init__(self, live: LiveSlam, show: Show, every: float) -> None:
        self._live, self._show, self._every = live, show, every
        self._stamp = self._shown = -1
        self.drawn, self.longest = 0, 0.0  # how many maps; how long [s] scans were held for one
        self.failed: Exception | None = None
        self._due = threading.Event()
        self._ending = False
        self._thread = threading.Thread(target=self._draw, name="maps", daemon=True)
        if every:
            self._thread.start()

    def seen(self, stamp: int) -> None:
        """Note that a scan of a stamp [ns] is in the map; the first is shown at once."""
        first = self._stamp < 0
        self._stamp = stamp
        if first:
            self._due.set()

    def close(self) -> None:
        """Show the last map and end."""
        self._ending = True
        self._due.set()
        if self._thread.is_alive():
            self._thread.join()

    def _draw(self) -> None:
        self._due.wait()
        while not self._ending:
            self._due.clear()
            self._show_new()
            self._due.wait(max(self._every, self._live.held / SHARE))
        self._show_new()

    def _show_new(self) -> None:
        stamp = self._stamp
        if stamp < 0 or stamp == self._shown:
            return
        try:
            self._show(stamp, self._live.map())
        except Exception as error:  # told by the node: scans go on
            self.failed = error
        self._shown = stamp
        self.drawn += 1
        self.longest = max(self.longest, self._live.held)
