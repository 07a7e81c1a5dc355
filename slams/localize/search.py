"""Search: where in a map a scan was taken, from nothing, and how sure that is."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from slams.localize.along import farther_along
from slams.localize.chart import Chart
from slams.localize.places import Places, ends_of, view_of
from slams.types import Floats, OccupancyGrid, Pose2, Scan, wrap_angle

TRIES = 60  # places that are looked at closely
APART, APART_TURN = 0.5, math.radians(15.0)  # m, rad: closer than this is the same place
LEAST_VIEW = 20  # directions; with fewer there is nothing to compare
INDEPENDENT = 30.0  # beams that tell something of their own; neighbors see the same wall
TIE = 0.03  # evidence; what differs by less is as good
ASTRAY = 0.1  # evidence that no fit loses
EVEN = 1e-3  # of the best one's odds; what has less is not kept


class Candidate(NamedTuple):
    """A place where the robot may be.

    `pose` of the base in the map; the shares of the scan's beams that the map explains and refutes
    there; `odds` 0..1, the chance that it is here, all candidates together 1.
    """

    pose: Pose2
    explained: float
    refuted: float
    odds: float

    @property
    def evidence(self) -> float:
        """Share of beams explained less the share refuted."""
        return self.explained - self.refuted


class Atlas:
    """A map with everything a search needs; made once, a second per 1000 m^2.

    Raises:
        ValueError: the map is no floor with walls.
    """

    def __init__(self, grid: OccupancyGrid) -> None:
        self.grid = grid
        self.chart = Chart(grid)
        self._ends: tuple[Scan, Floats] | None = None  # of the last scan

    @cached_property
    def places(self) -> Places:
        """What is seen from everywhere; made when it is first searched."""
        return Places(self.chart)

    def search(self, scan: Scan) -> list[Candidate]:
        """The places where a scan may have been taken, the most likely first; [] if none.

        Takes the same time for every scan: the number of places times that of directions.
        """
        view = view_of(scan)
        if len(view.directions) < LEAST_VIEW:
            return []
        back = scan.laser.mount.inverse()
        starts = self.places.rank(view, TRIES)
        looked = [self._looked_at(view.points, start) for start in starts]
        apart = _apart(sorted(looked, key=lambda c: -c.evidence))
        return with_odds([c._replace(pose=c.pose @ back) for c in apart])

    def look(self, scan: Scan, pose: Pose2) -> Candidate:
        """What speaks for the base being near `pose`, where it fits best; odds 1."""
        found = self._looked_at(self._ends_of(scan), pose @ scan.laser.mount)
        return found._replace(pose=found.pose @ scan.laser.mount.inverse())

    def farther_along(self, scan: Scan, pose: Pose2, along: Floats) -> Pose2 | None:
        """Where along the unit vector `along` (2,) the scan tells more than at the base's pose."""
        ends, mount = self._ends_of(scan), scan.laser.mount
        found = farther_along(self.chart, ends, pose @ mount, along)
        return None if found is None else found @ mount.inverse()

    def _ends_of(self, scan: Scan) -> Floats:
        if self._ends is None or self._ends[0] is not scan:
            self._ends = scan, ends_of(scan)  # places are looked at scan by scan
        return self._ends[1]

    def _looked_at(self, points: Floats, start: Pose2) -> Candidate:
        poses = (self.chart.fit(points, start), start)
        fitted, rough = [Candidate(p, *self.chart.explained(points, p), 1.0) for p in poses]
        pulled_away = fitted.evidence < rough.evidence - ASTRAY  # by people
        return rough if pulled_away else fitted


def with_odds(candidates: list[Candidate], before: Floats | None = None) -> list[Candidate]:
    """The candidates, the most likely first, with odds from their evidence and those `before`."""
    if not candidates:
        return []
    evidence = np.array([c.evidence for c in candidates])
    odds = np.exp(-INDEPENDENT * np.maximum(evidence.max() - evidence - TIE, 0.0))
    odds *= 1.0 if before is None else before
    odds /= odds.sum()
    order = np.argsort(-odds, kind="stable")
    kept = [candidates[i]._replace(odds=float(odds[i])) for i in order]
    return [c for c in kept if c.odds >= EVEN * kept[0].odds]


def _apart(candidates: list[Candidate]) -> list[Candidate]:
    """Of candidates at the same place the first."""
    kept: list[Candidate] = []
    for candidate in candidates:
        if not any(is_same(candidate.pose, other.pose) for other in kept):
            kept.append(candidate)
    return kept


def is_same(a: Pose2, b: Pose2) -> bool:
    """Whether two poses are of one place."""
    near = math.hypot(b.x - a.x, b.y - a.y) < APART  # most are not
    return near and abs(wrap_angle(b.theta - a.theta)) < APART_TURN
