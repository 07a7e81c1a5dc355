"""Relocator: brings an algorithm that is lost back to wherever its own map has the place."""

from __future__ import annotations

import math
from collections.abc import Callable

from slams.localize.finder import Finder
from slams.localize.old_ground import OldGround
from slams.localize.places import ends_of
from slams.localize.search import LEAST_VIEW, Atlas, Candidate, is_same
from slams.motion.track import Track
from slams.patience import Patience
from slams.types import OccupancyGrid, Pose2, Scan

STAYS = 8.0  # s that a place is looked for, on the way: alike ones differ a bit farther on
APART = 0.1  # s between two looks; a place has to stand in two of them
RARER = 0.15  # of the time it has been followed already: rest before the next look at a place
FIRST, LONGEST = 0.5, 8.0  # s of rest after looking in vain, doubled each time
EXPLAINED = 0.8  # evidence of a place: a wrong one is worse than none
SOON, EARLY = 0.6, 3.0  # the same in the first seconds [s]: the robot has hardly left the map
PACE = 1.0  # m/s, and m to begin with: no farther has a robot come that saw nothing
REFUTED = 0.1  # share of beams through walls from which a place is wrong, however much is alike
BETTER = 0.1  # evidence that another place has more, from which a match is in doubt


class Relocator:
    """A global search in an algorithm's own map, while its track is lost; `found` counts.

    The map is made ready once, when it is lost, some 0.1 s; a search takes some 30 ms, and the
    more seldom the longer it finds nothing. Who is adrift is not looked for: the map has the place,
    but not where it is. `old_ground` is for an algorithm to ask before it draws a scan.
    """

    def __init__(self, track: Track, on: bool) -> None:
        self.found = 0
        self.old_ground = OldGround(track, on)
        self._track, self._on = track, on
        self._atlas: Atlas | None = None
        self._before: float | None = None
        self._patience = Patience(FIRST, LONGEST)
        self._lost = False
        self._proves = False  # looks whether matches after a gap are right
        self._finder: Finder | None = None
        self._seconds = self._began = 0.0  # since the first lost scan; when it began to look
        self._seeing = 0.0  # s of these in which there was something to see
        self._left = track.pose  # where it was lost
        self._finish()

    @property
    def counts(self) -> dict[str, int]:
        """How often it was found: lost, anywhere; or drifted, on ground of old."""
        return {"found_again": self.found, "returned": self.old_ground.found}

    def update(self, scan: Scan, draw: Callable[[], OccupancyGrid]) -> bool:
        """After each scan; `draw` draws the map. Sets the track's pose where it is found.

        Returns whether it was.
        """
        before = self.found
        self._seek(scan, draw)
        return self.found > before

    def _seek(self, scan: Scan, draw: Callable[[], OccupancyGrid]) -> None:
        dt = 0.0 if self._before is None else max(scan.t - self._before, 0.0)
        self._before = scan.t
        track = self._track
        if not self._on or track.state != "lost" or track.adrift:
            self._finish()
            return
        self._patience.wait(dt)
        sees = len(ends_of(scan)) >= LEAST_VIEW
        if self._lost:
            self._seconds += dt
            self._seeing += dt if sees else 0.0
        else:
            self._left = track.pose
        self._lost = True
        if track.proving and not self._proves:
            self._anew()
        self._proves = track.proving
        if not sees:
            return
        if track.unproven and self._moved_along(scan, draw):
            return
        if track.unproven and self._refutes(scan, draw):
            track.refuted()
        if self._patience.over:
            self._look(scan, draw)

    def _finish(self) -> None:
        self._atlas = None
        self._seconds, self._seeing, self._lost, self._proves = 0.0, 0.0, False, False
        self._anew()
        self._patience.forget()

    def _anew(self) -> None:
        """Look anew, at once."""
        self._finder = None
        self._patience.again(0.0)

    def _refutes(self, scan: Scan, draw: Callable[[], OccupancyGrid]) -> bool:
        """Whether the map speaks against the place where the algorithm has matched the scan."""
        atlas = self._chart(draw)
        if atlas is None:
            return False
        here = atlas.look(scan, self._track.pose)
        others = self._finder.candidates if self._finder else []
        best = max((c.evidence for c in others if c.refuted < REFUTED), default=0.0)
        return here.refuted >= REFUTED or here.evidence < best - BETTER

    def _moved_along(self, scan: Scan, draw: Callable[[], OccupancyGrid]) -> bool:
        """Whether the robot, matched after a gap, was farther along a corridor: now it is there."""
        atlas = self._chart(draw)
        if atlas is None:
            return False
        found = atlas.farther_along(scan, self._track.pose, self._track.unseen)
        if found is not None:
            self._track.lost -= 1  # this scan counts already
            self._track.placed(found, scan, proven=False)
            self.found += 1
        return found is not None

    def _look(self, scan: Scan, draw: Callable[[], OccupancyGrid]) -> None:
        atlas = self._chart(draw)
        if atlas is None:
            self._patience.tried()
            return
        first = self._finder is None
        if self._finder is None:
            self._finder, self._began = Finder(atlas), self._seconds
        found = self._finder.add(scan)
        if found and self._convinces(found) and (not first or self._agrees(found)):
            self._return(found, scan)
        elif self._finder.candidates and self._seconds < self._began + STAYS:
            self._patience.again(max(APART, RARER * (self._seconds - self._began)))
        else:
            self._finder = None
            self._patience.tried()

    def _convinces(self, found: Candidate) -> bool:
        """Whether that is enough; of what a robot can have come to unseen less is."""
        off = math.hypot(found.pose.x - self._left.x, found.pose.y - self._left.y)
        near = off < PACE * (1.0 + self._seconds) and self._seeing < EARLY
        enough = SOON if near or self._seconds < EARLY else EXPLAINED
        return found.evidence >= enough and found.refuted < REFUTED

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

    def _chart(self, draw: Callable[[], OccupancyGrid]) -> Atlas | None:
        """The map as it was when the robot was lost; None if that is no floor yet."""
        if self._atlas is None:
            try:
                self._atlas = Atlas(draw())
            except ValueError:
                return None
        return self._atlas
