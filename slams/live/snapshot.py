"""A map drawn by a copy of this process, as the algorithm stood when it was copied.

`fork` copies a process in milliseconds, whatever its size: memory is shared until somebody writes
to it. The copy draws at its leisure, in no scan's way, not even by Python's lock, sends the map
back and is gone.
"""

from __future__ import annotations

import os
import sys
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection, Pipe
from typing import NoReturn, Protocol, runtime_checkable

from slams.types import OccupancyGrid, Slam

AT_HAND = sys.platform == "linux"  # elsewhere system libraries do not bear it, or there is none
POLITE = 10  # niceness of the copy: scans come first
LONGEST = 60.0  # [s] that a map may take


@runtime_checkable
class Sketched(Protocol):
    """An algorithm that can say quickly what its map is to be drawn from."""

    def sketch(self) -> Callable[[], OccupancyGrid]:
        """What draws the map as it stands now, in any thread, while updates go on."""
        ...


def sketch(slam: Slam) -> Callable[[], OccupancyGrid]:
    """What draws the map as it stands now; where the algorithm has no such, the map is drawn."""
    if isinstance(slam, Sketched):
        return slam.sketch()
    grid = slam.map()
    return lambda: grid


class Snapshot:
    """An algorithm as it stands now, to draw from.

    `seconds` is the CPU time that its sketch took, once there is a map.

    Raises:
        OSError: the system has no room for another process.
    """

    def __init__(self, slam: Slam) -> None:
        self.seconds = 0.0
        self._maps, sending = Pipe(duplex=False)
        with sending, warnings.catch_warnings():
            # of threads that the copy does not have: it only draws
            warnings.simplefilter("ignore", DeprecationWarning)
            self._process = os.fork()
            if self._process == 0:
                _draw(slam, sending)

    def map(self) -> OccupancyGrid:
        """The map of then; to be called once.

        Raises:
            OSError: the copy was ended from outside, or got stuck.
            RuntimeError: the algorithm could not draw; the sentence says why.
        """
        try:
            if not self._maps.poll(LONGEST):
                raise TimeoutError(f"no map within {LONGEST:g} s")
            drawn = self._maps.recv()
        except EOFError as error:
            raise ChildProcessError("the process that drew the map was ended") from error
        finally:
            self._end()
        if isinstance(drawn, str):
            raise RuntimeError(drawn)
        *grid, self.seconds = drawn
        return OccupancyGrid(*grid)

    def _end(self) -> None:
        self._maps.close()
        with suppress(ProcessLookupError):
            os.kill(self._process, 9)
        os.waitpid(self._process, 0)


def _draw(slam: Slam, sending: Connection) -> NoReturn:
    """In the copy: draw, send, and end without a word to anything else that was copied."""
    try:
        os.nice(POLITE)
        try:
            begun = time.process_time()
            draw = sketch(slam)
            seconds = time.process_time() - begun
            grid = draw()
            sending.send((grid.p, grid.resolution, grid.origin, seconds))
        except Exception as error:  # whatever it is, the node is to tell it
            sending.send(f"{type(error).__name__}: {error}")
    finally:
        os._exit(0)
