"""Finder: the place of a robot in a map, from nothing, over as many scans as it takes.

    >>> finder = Finder(read_map("map.yaml"))
    >>> for scan in log:
    ...     found = finder.add(scan)
    ...     if found:
    ...         break

Every place that the first scan may be of is kept. They move on with the robot; whenever it has gone
a bit, the map is searched again, and what each place explained before counts on. One that is left
is found; alike corridors stay in doubt until the robot has left them.
"""

from __future__ import annotations

import math

from slams.localize.search import Atlas, Candidate, merged
from slams.types import IDENTITY, OccupancyGrid, Pose2, Scan

SURE = 0.95  # odds from which a place is found
EXPLAINED = 0.5  # evidence from which a map is believed to have the place at all
WAY, TURN = 0.3, 0.3  # m, rad: after so much a scan tells something new
STILL = 2.0  # s after which there is a look without any way, too: slip, or no wheels


class Finder:
    """Takes scans until one place is left.

    `candidates` are the places where the robot may be after the last scan, the most likely first.
    A search costs the same CPU every time (some 30 ms for a floor of 500 m^2) and is made at most
    every `WAY` [m]; other scans cost less than a millisecond for each candidate.

    Args:
        place: the map, or an `Atlas` that is already made of it.

    Raises:
        ValueError: the map is no floor with walls.
    """

    def __init__(self, place: OccupancyGrid | Atlas) -> None:
        self.atlas = place if isinstance(place, Atlas) else Atlas(place)
        self.candidates: list[Candidate] = []
        self._before: Scan | None = None
        self._steps: list[Pose2] = []
        self._way = self._turn = self._seconds = 0.0

    def add(self, scan: Scan) -> Candidate | None:
        """Take the next scan; the place of the base, once it is sure, else None."""
        self._follow(scan)
        self._before = scan
        if self._is_due():
            self._weigh(scan)
        return self.found

    @property
    def found(self) -> Candidate | None:
        """The place that is left, if there is one."""
        best = self.candidates[0] if self.candidates else None
        sure = best is not None and best.odds >= SURE and best.evidence >= EXPLAINED
        return best if sure else None

    def _is_due(self) -> bool:
        far = self._way >= WAY or self._turn >= TURN
        return not self.candidates or far or self._seconds >= STILL

    def _follow(self, scan: Scan) -> None:
        """Move every candidate by the wheels, or once more by its last step, then to where it fits.

        The odds stay: neighboring scans see the same.
        """
        driven = _driven(self._before, scan)
        moved = []
        for number, candidate in enumerate(self.candidates):
            step = self._steps[number] if driven is None else driven
            seen = self.atlas.look(scan, candidate.pose @ step)
            moved.append(seen._replace(odds=candidate.odds))
            self._steps[number] = candidate.pose.between(seen.pose)
        self.candidates = moved
        self._seconds += 0.0 if self._before is None else max(scan.t - self._before.t, 0.0)
        if moved:
            self._way += math.hypot(*self._steps[0][:2])
            self._turn += abs(self._steps[0].theta)

    def _weigh(self, scan: Scan) -> None:
        """Search the map again; places that were kept before have their odds as a start."""
        kept = self.candidates
        steps = {id(c.pose): step for c, step in zip(kept, self._steps, strict=True)}
        self.candidates = merged(kept, self.atlas.search(scan))
        self._steps = [steps.get(id(c.pose), IDENTITY) for c in self.candidates]
        self._way = self._turn = self._seconds = 0.0


def _driven(before: Scan | None, scan: Scan) -> Pose2 | None:
    """The step of the wheels between two scans; None where they do not tell."""
    if before is None or before.odometry is None or scan.odometry is None:
        return None
    return before.odometry.between(scan.odometry)
