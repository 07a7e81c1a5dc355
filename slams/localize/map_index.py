"""MapIndex: what a search of a map needs, and the search of one scan in it, in bounded pieces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slams.localize.distance_map import DistanceMap
from slams.localize.view_lattice import (
    DIRECTIONS,
    EVERYWHERE,
    Disc,
    ViewLattice,
    end_points,
    view_of,
)
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan, wrap_angle

POSES = 60  # of the lattice that are fitted to the walls
SAME_XY, SAME_HEADING = 0.5, math.radians(15.0)  # m, rad: candidates closer than this are one
INDEPENDENT = 30.0  # beams whose errors are independent of each other; neighbors see the same wall
TIE = 0.03  # score; candidates that differ by less are equally likely
MIN_RATIO = 1e-3  # of the highest probability; less likely candidates are dropped
UNEXPECTED = 1e-2  # probability at least that none of the candidates so far is right
CELL, RAY, COMPARISON, FIT = 0.0129, 0.2, 4.5, 225.0  # us of one core of a small computer


class Work:
    """Work left for one scan [us]; counted in pieces of a fixed cost, never in time.

    So the same input gives the same output.
    """

    def __init__(self, limit: float) -> None:
        self._left = limit

    def take(self, pieces: int, cost: float) -> int:
        """How many of so many pieces may be done; they are taken off what is left."""
        taken = pieces if pieces * cost <= self._left else int(self._left / cost)
        self._left -= taken * cost
        return taken


class Candidate(NamedTuple):
    """A pose that the base may have.

    Inlier ratio and free-space conflict of the scan there; the probability that it is right, all
    candidates together at most 1; the step since the scan before; how many searches it stood.
    """

    pose: Pose2
    inliers: float
    conflicts: float
    probability: float = 1.0
    step: Pose2 = IDENTITY
    searches: int = 1

    @property
    def score(self) -> float:
        """Share of beams that are inliers, less those in conflict."""
        return self.inliers - self.conflicts

    def __str__(self) -> str:
        x, y, theta = self.pose
        return f"{x:.2f}, {y:.2f} m, {theta:.2f} rad ({self.inliers:.0%} of the scan explained)"


class MapIndex:
    """A map with its distances and its view lattice; a second of work per 1000 m^2.

    Args:
        grid: the map.
        max_points: of the lattice, about; None, as many as a given map may have.
        area: where a robot is searched for.

    Raises:
        ValueError: the map is no floor with walls.
    """

    def __init__(
        self, grid: OccupancyGrid, max_points: int | None = None, area: Disc = EVERYWHERE
    ) -> None:
        self.grid, self.distances = grid, DistanceMap(grid)
        self._max_points, self._area = max_points, area
        self._transforms = ["gap", "distances"]
        self._lattice: ViewLattice | None = None

    @property
    def lattice(self) -> ViewLattice:
        """The view lattice, complete."""
        self.prepare(Work(math.inf))
        assert self._lattice is not None
        return self._lattice

    def prepare(self, work: Work) -> bool:
        """Go on making what a search needs; whether it is complete."""
        while self._lattice is None:
            if not work.take(1, CELL * self.grid.p.size):
                return False
            if self._transforms:
                getattr(self.distances, self._transforms.pop(0))
            else:
                self._lattice = ViewLattice(self.distances, self._max_points, self._area)
        lattice = self._lattice
        lattice.cast(work.take(len(lattice) - lattice.done, RAY * DIRECTIONS))
        return lattice.done == len(lattice)

    def search(self, scan: Scan) -> list[Candidate]:
        """Candidates for a scan, the most likely first; [] if none or too few beams are valid.

        Takes the same time for every scan: the number of points times that of directions.
        """
        if not view_of(scan).enough:
            return []
        search = Search(self, scan)
        search.advance(Work(math.inf))
        return merged([], search.found)

    def match(self, scan: Scan, poses: Sequence[Pose2]) -> list[Candidate]:
        """For each pose of the base the candidate near it, where the scan fits best."""
        points, mount = end_points(scan), scan.laser.mount
        back, found = mount.inverse(), []
        for pose in poses:
            fitted = self.distances.fit(points, pose @ mount)
            found.append(Candidate(fitted @ back, *self.distances.evaluate(points, fitted)))
        return found


class Search:
    """One scan searched for at all points of the lattice; `found` are the poses fitted so far.

    The index is complete, and the scan has enough directions.
    """

    def __init__(self, index: MapIndex, scan: Scan) -> None:
        self.found: list[Candidate] = []
        self._index, self._scan, self._view = index, scan, view_of(scan)
        self._agree = np.empty((0, 2), np.int32)

    def advance(self, work: Work) -> bool:
        """Go on: compare with the points, then fit the best poses; whether all is done."""
        lattice, done = self._index.lattice, len(self._agree)
        if done < len(lattice):
            count = work.take(len(lattice) - done, COMPARISON)
            fresh = lattice.compare(self._view, done, count)
            self._agree = np.concatenate([self._agree, fresh])
            if len(self._agree) < len(lattice):
                return False
        best = np.argsort(-self._agree[:, 0], kind="stable")[:POSES]
        left = best[len(self.found) :]
        some = left[: work.take(len(left), FIT)]
        back = self._scan.laser.mount.inverse()
        starts = [pose @ back for pose in lattice.poses(some, self._agree[some, 1])]
        self.found += self._index.match(self._scan, starts)
        return len(some) == len(left)


def merged(known: list[Candidate], found: list[Candidate]) -> list[Candidate]:
    """Candidates so far and those found by a search of the same scan, the most likely first.

    Bayes' rule: the known ones begin with their probability; each other one with that of none of
    the known being right.
    """
    known = distinct(known)
    found = sorted(found, key=lambda candidate: -candidate.score)
    fresh = distinct([*known, *found])[len(known) :]
    rest = max(UNEXPECTED, 1.0 - sum(candidate.probability for candidate in known))
    before = [c.probability for c in known] + [rest] * len(fresh)
    stood = [c._replace(searches=c.searches + 1) for c in known]
    return _weighed(stood + fresh, np.array(before))


def _weighed(candidates: list[Candidate], before: Floats) -> list[Candidate]:
    """The candidates by probability, from their scores and the probabilities `before`."""
    if not candidates:
        return []
    scores = np.array([candidate.score for candidate in candidates])
    odds = before * np.exp(-INDEPENDENT * np.maximum(scores.max() - scores - TIE, 0.0))
    odds /= odds.sum()
    order = np.argsort(-odds, kind="stable")
    kept = order[odds[order] >= MIN_RATIO * odds.max()].tolist()
    return [candidates[i]._replace(probability=float(odds[i])) for i in kept]


def distinct(candidates: list[Candidate]) -> list[Candidate]:
    """Of candidates at the same place the first."""
    kept: list[Candidate] = []
    for candidate in candidates:
        if not any(is_same(candidate.pose, other.pose) for other in kept):
            kept.append(candidate)
    return kept


def is_same(a: Pose2, b: Pose2) -> bool:
    """Whether two poses are one place."""
    near = math.hypot(b.x - a.x, b.y - a.y) < SAME_XY  # most are not
    return near and abs(wrap_angle(b.theta - a.theta)) < SAME_HEADING
