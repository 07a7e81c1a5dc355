"""MapIndex: what a search of a map needs, and the search of one scan in it, in bounded pieces.

ours: correlative matching in one square of the map after the other, at all headings. It knows end
points alone; of the best poses of a square the beams that go through walls are taken off.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.frontend import correlative
from slams.frontend.correlative import LikelihoodField, Window, pooled_field, search
from slams.localize.distance_map import ROBUST_DISTANCES, DistanceMap
from slams.localize.virtual import NARROW
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan, wrap_angle

MIN_BEAMS = 20  # valid ones: in fewer there is nothing to compare
TILE = 2.8  # m, half of a square that is searched in one piece: a few ms
SAMPLED = 0.1  # m, about, between two cells of the likelihood
BLOCK = 4  # of these, in a coarse shift: in 0.8 m there is a wall almost everywhere
POSES = 60  # that are fitted to the walls
SAME_XY, SAME_HEADING = 0.5, math.radians(15.0)  # m, rad: candidates closer than this are one
INDEPENDENT = 30.0  # beams whose errors are independent of each other; neighbors see the same wall
TIE = 0.03  # score; candidates that differ by less are equally likely
MIN_RATIO = 1e-3  # of the highest probability; less likely candidates are dropped
UNEXPECTED = 1e-2  # probability at least that none of the candidates so far is right
CELL, LOOKUP, EVALUATION, FIT = 0.0129, 0.0015, 45.0, 225.0  # us of one core of a small computer


class Work:
    """Work left for one scan [us]; counted in pieces of a known cost, never in time.

    So the same input gives the same output. The first piece may cost more than there is.
    """

    def __init__(self, limit: float = math.inf) -> None:
        self._limit = self._left = limit

    def take(self, cost: float) -> bool:
        """Whether a piece of this cost may be done; it is taken off what is left."""
        is_first = self._left == self._limit
        if cost > self._left and not is_first:
            return False
        self._left -= cost
        return True


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


def end_points(scan: Scan) -> Floats:
    """End points (n, 2) [m] of the valid beams in the laser's frame."""
    valid = np.flatnonzero(np.isfinite(scan.ranges) & (scan.ranges > 0.0))
    return np.asarray(scan.ranges[valid, None].astype(np.float64) * scan.laser.directions[valid])


def has_enough(scan: Scan) -> bool:
    """Whether enough beams are valid to search for a scan."""
    return len(end_points(scan)) >= MIN_BEAMS


class MapIndex:
    """A map with its distances, its likelihood of walls and the squares a robot can be in.

    Raises:
        ValueError: the map is no floor with walls.
    """

    def __init__(self, grid: OccupancyGrid) -> None:
        self.grid, self.distances = grid, DistanceMap(grid)
        self._missing = ["tiles", "likelihood_field"]

    @cached_property
    def tiles(self) -> list[Pose2]:
        """The middles of the squares in which a laser has room, in rows from the lowest y."""
        room, cell = self._room, self.distances.resolution
        side = math.ceil(2.0 * TILE / cell)
        (x0, y0), found = self.distances.origin.tolist(), []
        for j, i in np.ndindex(*(math.ceil(n / side) for n in room.shape)):
            if room[j * side : (j + 1) * side, i * side : (i + 1) * side].any():
                found.append(Pose2(x0 + (i + 0.5) * side * cell, y0 + (j + 0.5) * side * cell, 0.0))
        return found

    @cached_property
    def likelihood_field(self) -> LikelihoodField:
        """Likelihood of walls: 1 at one, 0 from where on none pulls in the first round of a fit."""
        cell = self.distances.resolution
        every = max(1, round(SAMPLED / cell))
        first = every // 2
        wall = self.distances.distances.wall[first::every, first::every]
        likelihood = np.maximum(1.0 - wall * np.float32(cell / ROBUST_DISTANCES[0]), 0.0)
        x0, y0 = (self.distances.origin + (first + 0.5) * cell).tolist()
        return pooled_field(LikelihoodField(likelihood, x0, y0, every * cell), BLOCK)

    def prepare(self, work: Work) -> bool:
        """Go on making what a search needs; whether it is complete."""
        while self._missing and work.take(CELL * self.grid.p.size):
            getattr(self, self._missing.pop(0))
        return not self._missing

    def has_room(self, poses: Floats) -> NDArray[np.bool_]:
        """Which poses (n, 4) of a laser are in free space, or beside it."""
        cells = np.floor((poses[:, :2] - self.distances.origin) / self.distances.resolution)
        ix, iy = cells.astype(np.int64).T
        ny, nx = self._room.shape
        inside: NDArray[np.bool_] = (ix >= 0) & (iy >= 0) & (ix < nx) & (iy < ny)
        inside[inside] = self._room[iy[inside], ix[inside]]
        return inside

    def search(self, scan: Scan) -> list[Candidate]:
        """Candidates for a scan, the most likely first; [] if none or too few beams are valid."""
        if not has_enough(scan):
            return []
        search = Search(self, scan)
        search.advance(Work())
        return merged([], search.found)

    def match(self, scan: Scan, poses: Sequence[Pose2]) -> list[Candidate]:
        """For each pose of the base the candidate near it, where the scan fits best."""
        points, mount = end_points(scan), scan.laser.mount
        back, found = mount.inverse(), []
        for pose in poses:
            fitted = self.distances.fit(points, pose @ mount)
            found.append(Candidate(fitted @ back, *self.distances.evaluate(points, fitted)))
        return found

    @cached_property
    def _room(self) -> NDArray[np.bool_]:
        """Where a laser can be, give or take two steps of a search: not all around it was seen."""
        import cv2

        cell = self.distances.resolution
        steps = 2 * math.ceil(2.0 * SAMPLED / cell) + 1
        room = (self.distances.gap * cell > NARROW).astype(np.uint8)
        return np.asarray(cv2.dilate(room, np.ones((steps, steps), np.uint8)) > 0)


class Search:
    """One scan searched for in all squares; `found` are the poses fitted so far.

    The scan has enough beams.
    """

    def __init__(self, index: MapIndex, scan: Scan) -> None:
        self.found: list[Candidate] = []
        self._index, self._scan = index, scan
        points = end_points(scan)
        self._ends = points[:: max(1, len(points) // correlative.N_SEARCH_BEAMS)]
        self._tiles = list(index.tiles)  # to be searched
        self._cost = POSES * EVALUATION  # [us] of the last one, about that of the next
        self._likely = np.empty((0, 4))  # poses of the laser, and likelihood less conflicts there
        self._starts: list[Pose2] | None = None  # of the base, to be fitted

    def advance(self, work: Work) -> bool:
        """Go on: search the squares, then fit the best poses; whether all is done."""
        while self._tiles:
            if not work.take(self._cost):
                return False
            self._look(self._tiles.pop(0))
        if self._starts is None:
            back = self._scan.laser.mount.inverse()
            best = thinned(self._likely)[:, :3].tolist()
            self._starts = [Pose2(*pose) @ back for pose in best]
        while self._starts and work.take(FIT):
            self.found += self._index.match(self._scan, [self._starts.pop(0)])
        return not self._starts

    def _look(self, tile: Pose2) -> None:
        """Search a square, and keep its likely poses in free space."""
        window, distances = Window(tile, TILE, math.pi), self._index.distances
        tolerance = correlative.SEARCH_SCORE_TOLERANCE
        enough = self._likely[:, 3].max(initial=tolerance) - tolerance
        poses, lookups = search(
            self._index.likelihood_field, self._ends.T, window, enough, tolerance
        )
        good = thinned(poses[(poses[:, 3] > enough) & self._index.has_room(poses)])
        for pose in good:
            pose[3] -= distances.evaluate(self._ends, Pose2(*pose[:3].tolist()))[1]
        self._likely = np.concatenate([self._likely, good])
        self._cost = lookups * LOOKUP + len(good) * EVALUATION


def thinned(poses: Floats) -> Floats:
    """The best of poses (n, 4) with their likelihood, away from each other by half a place."""
    left, kept = poses[np.argsort(-poses[:, 3], kind="stable")], np.empty((0, 4))
    while len(left) and len(kept) < POSES:
        kept = np.vstack([kept, left[:1]])
        turn = np.abs(np.remainder(left[:, 2] - left[0, 2] + math.pi, 2.0 * math.pi) - math.pi)
        near = np.hypot(left[:, 0] - left[0, 0], left[:, 1] - left[0, 1]) < 0.5 * SAME_XY
        left = left[~(near & (turn < 0.5 * SAME_HEADING))]
    return kept


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
