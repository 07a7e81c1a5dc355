"""Relocator: brings an algorithm that is lost back to wherever its own map has the place."""

from __future__ import annotations

from collections.abc import Callable

from slams.localize.finder import Finder
from slams.localize.places import ends_of
from slams.localize.search import LEAST_VIEW, Atlas, Candidate, is_same
from slams.motion.track import Track
from slams.patience import Patience
from slams.types import OccupancyGrid, Pose2, Scan

LOOKS = 3  # scans that a place is looked for with: it has to stand in two of them
APART = 0.1  # s between two of them
FIRST, LONGEST = 0.5, 8.0  # s of rest after looking in vain, doubled each time
EXPLAINED = 0.7  # evidence of a place: a wrong one is worse than none


class Relocator:
    """A global search in an algorithm's own map, while its track is lost; `found` counts.

    The map is made ready once, when it is lost, some 0.1 s; a search takes some 30 ms, and the
    more seldom the longer it finds nothing. Who is adrift is not looked for: the map has the place,
    but not where it is.
    """

    def __init__(self, track: Track, on: bool) -> None:
        self.found = 0
        self._track, self._on = track, on
        self._atlas: Atlas | None = None
        self._finder: Finder | None = None
        self._before: float | None = None
        self._patience = Patience(FIRST, LONGEST)
        self._proves = False  # looks whether a match after a gap is right
        self._finish()

    def update(self, scan: Scan, draw: Callable[[], OccupancyGrid]) -> None:
        """After each scan; `draw` draws the map. Sets the track's pose where it is found."""
        dt = 0.0 if self._before is None else max(scan.t - self._before, 0.0)
        self._before = scan.t
        track = self._track
        if not self._on or track.state != "lost" or track.adrift:
            self._finish()
            return
        self._patience.wait(dt)
        if track.unproven and not self._proves:
            self._finder, self._looks = None, 0
            self._patience.again(0.0)
        self._proves = track.unproven
        if self._patience.over and len(ends_of(scan)) >= LEAST_VIEW:
            self._look(scan, draw)

    def _finish(self) -> None:
        self._atlas = self._finder = None
        self._looks, self._proves = 0, False
        self._patience.forget()

    def _look(self, scan: Scan, draw: Callable[[], OccupancyGrid]) -> None:
        finder = self._ready(draw)
        found = finder.add(scan) if finder else None
        self._looks += 1
        if found and found.evidence >= EXPLAINED and (self._looks > 1 or self._agrees(found)):
            self._return(found, scan)
        elif finder and self._looks < LOOKS and finder.candidates:
            self._patience.again(APART)
        else:
            self._finder, self._looks = None, 0
            self._patience.tried()

    def _agrees(self, found: Candidate) -> bool:
        """Whether the algorithm has matched the scan there, too."""
        return self._track.unproven and is_same(found.pose, self._track.pose)

    def _return(self, found: Candidate, scan: Scan) -> None:
        self._track.lost -= 1  # this scan is not, after all
        if self._agrees(found):
            self._track.proven()
        else:
            self._track.placed(Pose2(*map(float, found.pose)), scan)
            self.found += 1
        self._finish()

    def _ready(self, draw: Callable[[], OccupancyGrid]) -> Finder | None:
        """A finder in the map as it was when the robot was lost; None if that is no floor yet."""
        if self._atlas is None:
            try:
                self._atlas = Atlas(draw())
            except ValueError:
                return None
        if self._finder is None:
            self._finder = Finder(self._atlas)
        return self._finder
