"""Search: where in a map a scan was taken, from nothing, and how sure that is."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from slams.localize.chart import Chart
from slams.localize.places import Places, Ranking, ends_of, view_of
from slams.types import Floats, OccupancyGrid, Pose2, Scan, wrap_angle

TRIES = 60  # places that are looked at closely
APART, APART_TURN = 0.5, math.radians(15.0)  # m, rad: closer than this is the same place
LEAST_VIEW = 20  # directions; with fewer there is nothing to compare
INDEPENDENT = 30.0  # beams that tell something of their own; neighbors see the same wall
TIE = 0.03  # evidence; what differs by less is as good
ASTRAY = 0.1  # evidence that no fit loses
EVEN = 1e-3  # of the best one's odds; what has less is not kept
SURPRISE = 1e-2  # odds of a place that was not among those kept


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
        if not shows_enough(scan):
            return []
        search = Search(self, scan)
        search.compare(len(self.places))
        search.look(TRIES)
        return with_odds(search.candidates)

    def look(self, scan: Scan, pose: Pose2) -> Candidate:
        """What speaks for the base being near `pose`, where it fits best; odds 1."""
        found = self._looked_at(self._ends_of(scan), pose @ scan.laser.mount)
        return found._replace(pose=found.pose @ scan.laser.mount.inverse())

    def _ends_of(self, scan: Scan) -> Floats:
        if self._ends is None or self._ends[0] is not scan:
            self._ends = scan, ends_of(scan)  # places are looked at scan by scan
        return self._ends[1]

    def _looked_at(self, points: Floats, start: Pose2) -> Candidate:
        """What speaks for the laser being near `start`, from where it sees points (n, 2) [m]."""
        poses = (self.chart.fit(points, start), start)
        fitted, rough = [Candidate(p, *self.chart.explained(points, p), 1.0) for p in poses]
        pulled_away = fitted.evidence < rough.evidence - ASTRAY  # by people
        return rough if pulled_away else fitted


class Search:
    """One scan searched in a map, all at once or in pieces: `compare`, then `look`.

    The scan shows enough (`shows_enough`).
    """

    def __init__(self, atlas: Atlas, scan: Scan) -> None:
        self._atlas, self._view = atlas, view_of(scan)
        self._back = scan.laser.mount.inverse()
        self._ranking = Ranking(atlas.places, self._view)
        self._starts: list[Pose2] | None = None
        self._looked: list[Candidate] = []

    @property
    def to_compare(self) -> int:
        """How many points of the lattice are left."""
        return len(self._atlas.places) - self._ranking.done

    @property
    def to_look(self) -> int:
        """How many places are left to be looked at closely, once all are compared."""
        return min(TRIES, len(self._atlas.places)) - len(self._looked)

    def compare(self, count: int) -> None:
        """Compare the scan with what is seen from the next `count` points of the lattice."""
        self._ranking.compare(count)

    def look(self, count: int) -> None:
        """Look closely at the next `count` of the `TRIES` best places."""
        if self._starts is None:
            self._starts = self._ranking.best(TRIES)
        first = len(self._looked)
        for start in self._starts[first : first + count]:
            self._looked.append(self._atlas._looked_at(self._view.points, start))

    @property
    def candidates(self) -> list[Candidate]:
        """Places of the base, each once, those with most evidence first; odds 1."""
        kept = apart(sorted(self._looked, key=lambda c: -c.evidence))
        return [c._replace(pose=c.pose @ self._back) for c in kept]


def shows_enough(scan: Scan) -> bool:
    """Whether a scan has valid ranges in enough directions to be compared with a map."""
    return len(view_of(scan).directions) >= LEAST_VIEW


def merged(kept: list[Candidate], fresh: list[Candidate]) -> list[Candidate]:
    """Places kept so far and those of a new search of the same scan, the most likely first.

    Those kept have their odds as a start, others `SURPRISE`.
    """
    new = [c for c in fresh if not any(is_same(c.pose, known.pose) for known in kept)]
    before = [c.odds for c in kept] + [SURPRISE if kept else 1.0] * len(new)
    return with_odds(kept + new, np.array(before))


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


def apart(candidates: list[Candidate]) -> list[Candidate]:
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
