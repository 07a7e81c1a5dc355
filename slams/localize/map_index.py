"""MapIndex: data of a map for global localization, and the search for a scan in bounded pieces.

ours: correlative matching of the end points in one square tile of the map after the other, at all
headings. The score of the best poses is reduced by the beams that pass through walls.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from slams.frontend.correlative import (
    N_SEARCH_BEAMS,
    SEARCH_SCORE_TOLERANCE,
    LikelihoodField,
    Window,
    pooled_field,
    search,
)
from slams.localize.distance_map import ROBUST_DISTANCES, DistanceMap
from slams.localize.virtual import MIN_CLEARANCE
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan, wrap_angle

MIN_VALID_BEAMS = 20  # of a scan that can be localized
TILE_HALF_WIDTH = 2.8  # m of a square that is searched in one piece: a few ms
LIKELIHOOD_CELL = 0.1  # m, about
LIKELIHOOD_BLOCK = 4  # cells of a coarse shift; larger blocks have a wall almost everywhere
MAX_FITTED_POSES = 60  # of a search
SAME_POSE_DISTANCE, SAME_POSE_ROTATION = 0.5, math.radians(15.0)  # m, rad: one candidate
INDEPENDENT_BEAMS = 30.0  # of a scan: neighbors on a wall have correlated errors
SCORE_TOLERANCE = 0.03  # difference of two equally likely candidates
MIN_PROBABILITY_RATIO = 1e-3  # to the most likely candidate; less likely ones are dropped
MIN_OTHER_PROBABILITY = 1e-2  # that none of the candidates so far is right
# us of one core of a small computer
CELL_COST, LOOKUP_COST, EVALUATION_COST, FIT_COST = 0.0129, 0.0015, 45.0, 225.0


class Work:
    """Work left for one scan [us], counted in pieces of fixed cost instead of measured time.

    The same input therefore gives the same output. The first piece may cost more than the limit.
    """

    def __init__(self, limit: float = math.inf) -> None:
        self._limit = self._left = limit

    def take(self, cost: float) -> bool:
        """Whether a piece of this cost may be done; reduces the work left by this cost."""
        is_first = self._left == self._limit
        if cost > self._left and not is_first:
            return False
        self._left -= cost
        return True


class Candidate(NamedTuple):
    """A hypothesis for the pose of the base, with inlier ratio and free-space conflict of the scan.

    `probability` that it is right, over all candidates at most 1; `step` since the last scan;
    `searches` that it was weighed in.
    """

    pose: Pose2
    inliers: float
    conflicts: float
    probability: float = 1.0
    step: Pose2 = IDENTITY
    searches: int = 1

    @property
    def score(self) -> float:
        """Inlier ratio minus free-space conflict."""
        return self.inliers - self.conflicts

    def __str__(self) -> str:
        x, y, theta = self.pose
        return f"{x:.2f}, {y:.2f} m, {theta:.2f} rad ({self.inliers:.0%} of the scan explained)"


def end_points(scan: Scan) -> Floats:
    """End points (n, 2) [m] of the valid beams in the laser's frame."""
    valid = np.flatnonzero(np.isfinite(scan.ranges) & (scan.ranges > 0.0))
    return np.asarray(scan.ranges[valid, None].astype(np.float64) * scan.laser.directions[valid])


def has_enough(scan: Scan) -> bool:
    """Whether a scan has enough valid beams to be localized."""
    return len(end_points(scan)) >= MIN_VALID_BEAMS


class MapIndex:
    """A map with its distances, its likelihood field and the tiles in which a robot can be.

    Raises:
        ValueError: the map has no wall or no free space.
    """

    def __init__(self, grid: OccupancyGrid) -> None:
        self.grid, self.distances = grid, DistanceMap(grid)
        self._missing = ["tiles", "likelihood_field"]

    @cached_property
    def tiles(self) -> list[Pose2]:
        """Centers of the tiles with positions for a laser, in rows from the lowest y."""
        free, cell = self._free, self.distances.resolution
        side = math.ceil(2.0 * TILE_HALF_WIDTH / cell)
        (x0, y0), found = self.distances.origin.tolist(), []
        for j, i in np.ndindex(*(math.ceil(n / side) for n in free.shape)):
            if free[j * side : (j + 1) * side, i * side : (i + 1) * side].any():
                found.append(Pose2(x0 + (i + 0.5) * side * cell, y0 + (j + 0.5) * side * cell, 0.0))
        return found

    @cached_property
    def likelihood_field(self) -> LikelihoodField:
        """Likelihood of an end point: 1 at a wall, 0 from the first robust distance of a fit on."""
        cell = self.distances.resolution
        every = max(1, round(LIKELIHOOD_CELL / cell))
        first = every // 2
        wall = self.distances.distances.wall[first::every, first::every]
        likelihood = np.maximum(1.0 - wall * np.float32(cell / ROBUST_DISTANCES[0]), 0.0)
        x0, y0 = (self.distances.origin + (first + 0.5) * cell).tolist()
        return pooled_field(LikelihoodField(likelihood, x0, y0, every * cell), LIKELIHOOD_BLOCK)

    def prepare(self, work: Work) -> bool:
        """Continue to compute the data that a search needs; whether they are complete."""
        while self._missing and work.take(CELL_COST * self.grid.p.size):
            getattr(self, self._missing.pop(0))
        return not self._missing

    def in_free_space(self, poses: Floats) -> NDArray[np.bool_]:
        """Which poses (n, 4) of a laser are in or close to free space."""
        cells = np.floor((poses[:, :2] - self.distances.origin) / self.distances.resolution)
        ix, iy = cells.astype(np.int64).T
        ny, nx = self._free.shape
        inside: NDArray[np.bool_] = (ix >= 0) & (iy >= 0) & (ix < nx) & (iy < ny)
        inside[inside] = self._free[iy[inside], ix[inside]]
        return inside

    def match(self, scan: Scan, poses: Sequence[Pose2]) -> list[Candidate]:
        """The candidate near each pose of the base, after a fit of the scan to the walls."""
        points, mount = end_points(scan), scan.laser.mount
        back, found = mount.inverse(), []
        for pose in poses:
            fitted = self.distances.fit(points, pose @ mount)
            found.append(Candidate(fitted @ back, *self.distances.evaluate(points, fitted)))
        return found

    @cached_property
    def _free(self) -> NDArray[np.bool_]:
        """Cells where a laser can be, extended by two steps of a search into unknown cells."""
        cell = self.distances.resolution
        steps = 2 * math.ceil(2.0 * LIKELIHOOD_CELL / cell) + 1
        free = (self.distances.gap * cell > MIN_CLEARANCE).astype(np.uint8)
        return np.asarray(cv2.dilate(free, np.ones((steps, steps), np.uint8)) > 0)


class Search:
    """Search for one scan with enough beams in all tiles; `found`: candidates fitted so far."""

    def __init__(self, index: MapIndex, scan: Scan) -> None:
        self.found: list[Candidate] = []
        self._index, self._scan = index, scan
        points = end_points(scan)
        self._ends = points[:: max(1, len(points) // N_SEARCH_BEAMS)]
        self._tiles = list(index.tiles)  # still to search
        self._cost = MAX_FITTED_POSES * EVALUATION_COST  # us of the last tile; estimate of the next
        self._likely = np.empty((0, 4))  # poses of the laser, and likelihood minus conflicts
        self._starts: list[Pose2] | None = None  # poses of the base, still to fit

    def advance(self, work: Work) -> bool:
        """Continue: search the tiles, then fit the best poses; whether the search is complete."""
        while self._tiles:
            if not work.take(self._cost):
                return False
            self._search_tile(self._tiles.pop(0))
        if self._starts is None:
            back = self._scan.laser.mount.inverse()
            best = distinct_poses(self._likely)[:, :3].tolist()
            self._starts = [Pose2(*pose) @ back for pose in best]
        while self._starts and work.take(FIT_COST):
            self.found += self._index.match(self._scan, [self._starts.pop(0)])
        return not self._starts

    def _search_tile(self, tile: Pose2) -> None:
        """Search one tile; keep its likely poses in free space."""
        window, distances = Window(tile, TILE_HALF_WIDTH, math.pi), self._index.distances
        tolerance, field = SEARCH_SCORE_TOLERANCE, self._index.likelihood_field
        enough = self._likely[:, 3].max(initial=tolerance) - tolerance
        poses, lookups = search(field, self._ends.T, window, enough, tolerance)
        good = distinct_poses(poses[(poses[:, 3] > enough) & self._index.in_free_space(poses)])
        for pose in good:
            pose[3] -= distances.evaluate(self._ends, Pose2(*pose[:3].tolist()))[1]
        self._likely = np.concatenate([self._likely, good])
        self._cost = lookups * LOOKUP_COST + len(good) * EVALUATION_COST


def distinct_poses(poses: Floats) -> Floats:
    """The best poses (n, 4), with likelihoods, apart by half the distance of two candidates."""
    left, kept = poses[np.argsort(-poses[:, 3], kind="stable")], np.empty((0, 4))
    while len(left) and len(kept) < MAX_FITTED_POSES:
        kept = np.vstack([kept, left[:1]])
        rotation = np.abs(np.remainder(left[:, 2] - left[0, 2] + math.pi, 2.0 * math.pi) - math.pi)
        near = np.hypot(left[:, 0] - left[0, 0], left[:, 1] - left[0, 1]) < 0.5 * SAME_POSE_DISTANCE
        left = left[~(near & (rotation < 0.5 * SAME_POSE_ROTATION))]
    return kept


def merged(known: list[Candidate], found: list[Candidate]) -> list[Candidate]:
    """Known candidates and those found by a search for the same scan, the most likely first.

    Bayes' rule: the prior of a known candidate is its probability; the prior of any other is the
    probability that none of the known ones is right.
    """
    known = distinct(known)
    rest = max(MIN_OTHER_PROBABILITY, 1.0 - sum(candidate.probability for candidate in known))
    candidates = [c._replace(searches=c.searches + 1) for c in known]
    candidates += [c._replace(probability=rest) for c in sorted(found, key=lambda c: -c.score)]
    candidates = distinct(candidates)
    if not candidates:
        return []
    scores = np.array([candidate.score for candidate in candidates])
    less = np.maximum(scores.max() - scores - SCORE_TOLERANCE, 0.0)
    prior = np.array([candidate.probability for candidate in candidates])
    odds = prior * np.exp(-INDEPENDENT_BEAMS * less)
    odds /= odds.sum()
    order = np.argsort(-odds, kind="stable")
    kept = order[odds[order] >= MIN_PROBABILITY_RATIO * odds.max()].tolist()
    return [candidates[i]._replace(probability=float(odds[i])) for i in kept]


def distinct(candidates: list[Candidate]) -> list[Candidate]:
    """The first of all candidates with the same pose."""
    kept: list[Candidate] = []
    for candidate in candidates:
        if not any(is_same(candidate.pose, other.pose) for other in kept):
            kept.append(candidate)
    return kept


def is_same(a: Pose2, b: Pose2) -> bool:
    """Whether two poses are one candidate."""
    near = math.hypot(b.x - a.x, b.y - a.y) < SAME_POSE_DISTANCE  # false for most
    return near and abs(wrap_angle(b.theta - a.theta)) < SAME_POSE_ROTATION
