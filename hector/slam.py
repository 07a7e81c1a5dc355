"""Hector SLAM: scan matching by gradient on a pyramid of occupancy grids.

[Kohlbrecher11] S. Kohlbrecher, O. von Stryk, J. Meyer, U. Klingauf: A Flexible and Scalable SLAM
System with Full 3D Motion Estimation. IEEE SSRR 2011. Per scan:

1. End points of the beams in the base frame (sec. IV-A).
2. A start for the pose.
3. Scan matching (sec. IV-B): Gauss-Newton, coarse to fine (sec. IV-C); ours: where the start is
   good, straight on the lines inside the finest cells.
4. ours: if the map does not explain the scan, other starts and a search; refuse what stays bad.
5. If the robot has moved, insert the scan into every level (sec. IV-A).

The published program, `hector@original`, stands in `original`.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, NamedTuple

import numpy as np

from hector.map import LogOddsPyramid
from hector.match_kernels import Solver
from hector.params import HectorParams
from hector.scan import EndPoints
from hector.surface_kernels import Fit
from slams.motion.model import Prediction
from slams.motion.track import Track
from slams.params import Params
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan, State

QUIETEST = 0.001  # m, noise of a beam where the map fits without any


class Match(NamedTuple):
    """A matched pose, the share of beams explained by the map, their mean square distance [m^2]."""

    pose: Pose2
    share: float
    square: float


class Hector:
    """Gradient map matching on a grid pyramid; see the module for the steps."""

    Params: ClassVar[type[Params]] = HectorParams

    def __init__(self, params: HectorParams) -> None:
        self.params = params
        self._map = LogOddsPyramid(params)
        self._scan = EndPoints(params)
        self._track = Track(params)
        self._solvers = _solvers(params)
        self._lines = Fit(params.steps_fine, params.converged, params.softness, 1.0)
        self._H = np.zeros((3, 3))
        self._match = self._key = Match(IDENTITY, 1.0, 0.0)
        self._usual = 1.0
        self._noise = params.range_noise**2
        names = ("empty", "inserted", "retried", "searched", "refused")
        self._counts = dict.fromkeys(names, 0)

    def update(self, scan: Scan) -> Pose2:
        """Match the scan to the map, let it enter the map if due; return T_map_base."""
        start = self._track.predict(scan)  # 1.
        points = self._scan.take(scan, start.velocity)  # 2.
        match = self._matched(points, start.pose)  # 3.
        if points.sweeps:
            points = self._scan.take(scan, self._track.motion.velocity_to(match.pose))
            match = self._matched(points, start.pose)
        if self._doubtful(points, match):  # 4.
            match, accepted = self._recovered(points, start, match)
        else:
            accepted = points.n > 0
        self._settle(scan, points, match, accepted)
        if self._due(points):  # 5.
            self._insert(points)
        return self._track.pose

    def map(self) -> OccupancyGrid:
        """The finest level as probabilities."""
        return self._map.grid()

    def report(self) -> dict[str, Any]:
        """Counts of scans: empty, inserted, retried, searched, refused; lost; with odometry ..."""
        counts = self._counts | {"lost": self._track.lost} | self._track.motion.counts
        return counts | self._map.extent.counts

    @property
    def state(self) -> State:
        """How the last pose came about."""
        return self._track.state

    @property
    def quality(self) -> float:
        """Share of the last scan's beams that the map explains, 0..1 (1 of the first scan)."""
        return self._match.share

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the last pose against the map [m^2, m rad, rad^2]."""
        return self._track.covariance

    def _matched(self, points: EndPoints, start: Pose2) -> Match:
        """Step 3, on the lines."""
        if self._map.insertions == 0 or points.n == 0:
            return self._match._replace(pose=start)
        prior = self._track.prior(start)
        how = self._lines._replace(variance=self._noise)
        return Match(*self._map.fit(points, start, prior, how, self._H))

    def _coarse_to_fine(self, points: EndPoints, pose: Pose2) -> Pose2:
        prior = self._track.prior(pose)
        for level, solver in self._solvers:
            pose = self._map.match(level, points, pose, prior, solver, self._H)
        return pose

    def _doubtful(self, points: EndPoints, match: Match) -> bool:
        """Whether the start may be out of the lines' reach, or the map explains less than usual."""
        if self._map.insertions == 0 or points.n == 0:
            return False
        wide = 2.0 * self._track.uncertain > 0.5 * self.params.resolution
        less = match.share < self.params.convincing * self._usual
        return wide or less or not self._track.reachable(match.pose)

    def _recovered(self, points: EndPoints, start: Prediction, match: Match) -> tuple[Match, bool]:
        """Step 4: the best of other starts; if that is bad, of a search; whether it is good."""
        self._counts["retried"] += 1
        before = self._track.pose
        starts = [start.pose, before @ start.continued, before]
        tried = [match, *(self._matched(points, self._coarse_to_fine(points, s)) for s in starts)]
        best, evidence = self._best(points, tried)
        if evidence < self.params.lost:
            self._counts["searched"] += 1
            found = self._map.search(points, start.pose)
            tried = [best, *(self._matched(points, self._coarse_to_fine(points, s)) for s in found)]
            best, evidence = self._best(points, tried)
        accepted = evidence >= self.params.lost and self._track.reachable(best.pose)
        return self._matched(points, best.pose), accepted

    def _best(self, points: EndPoints, tried: list[Match]) -> tuple[Match, float]:
        """The match with the most evidence, less the price of contradicting the prediction."""
        track = self._track
        possible = [match for match in tried if track.reachable(match.pose)] or tried[:1]
        evidence = [self._map.evidence(points, match.pose) for match in possible]
        charges = [track.charge(match.pose) for match in possible]
        best = int(np.argmax(np.subtract(evidence, charges)))
        return possible[best], evidence[best]

    def _settle(self, scan: Scan, points: EndPoints, match: Match, accepted: bool) -> None:
        """Tell the track what was found."""
        self._match = match
        if accepted:
            self._noise = max(match.square, QUIETEST**2)
            self._track.matched(match.pose, self._H / self._noise, scan)
            self._usual = match.share
        else:
            self._counts["refused"] += points.n > 0
            self._track.missed(scan)

    def _due(self, points: EndPoints) -> bool:
        """Step 5: far enough from the last insertion, or much that the map did not explain."""
        track, key = self._track, self._key
        if track.state != "matched":
            return self._new_surroundings(points)
        if self._map.insertions < self.params.settle:
            return True
        step = key.pose.between(track.pose)
        moved = math.hypot(step.x, step.y) > self.params.insert_distance
        turned = abs(step.theta) > self.params.insert_angle
        return moved or turned or self._match.share < self.params.convincing * key.share

    def _new_surroundings(self, points: EndPoints) -> bool:
        """Whether wheels alone have held the pose for long, and the map does not contradict it."""
        held = self._track.held and points.n > 0
        return held and self._map.evidence(points, self._track.pose) > 0.0

    def _insert(self, points: EndPoints) -> None:
        entered = self._map.insert(points, self._track.pose)
        self._key = self._match._replace(pose=self._track.pose)
        self._counts["inserted"] += entered


def _solvers(params: HectorParams) -> list[tuple[int, Solver]]:
    """The levels, coarse to fine, each with its Gauss-Newton."""
    rest = (params.max_shift, params.max_turn, params.converged, params.damping)
    coarse, fine = Solver(params.steps_coarse, *rest), Solver(params.steps_fine, *rest)
    return [(level, coarse if level else fine) for level in reversed(range(params.levels))]
