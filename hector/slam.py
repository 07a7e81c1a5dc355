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
from slams.motion import Motion
from slams.params import Params
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan


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
        self.frozen = False
        self._map = LogOddsPyramid(params)
        self._scan = EndPoints(params)
        self._motion = Motion(params.start)
        self._solvers = _solvers(params)
        self._lines = _line_fit(params)
        self._H = np.zeros((3, 3))
        self._match = Match(IDENTITY, 1.0, 0.0)
        self._key = self._match
        self._refused = 0
        names = ("empty", "inserted", "retried", "searched", "lost")
        self._counts = dict.fromkeys(names, 0)

    def update(self, scan: Scan) -> Pose2:
        """Match the scan to the map, let it enter the map if due; return T_map_base."""
        start = self._motion.predict(self._match.pose, scan)  # 1.
        points = self._scan.take(scan, self._motion.velocity)  # 2.
        self._counts["empty"] += points.n == 0
        match = self._matched(points, start)  # 3.
        if points.sweeps:
            points = self._scan.take(scan, self._motion.velocity_to(match.pose))
            match = self._matched(points, match.pose)
        if self._doubtful(points, match):  # 4.
            match = self._recovered(points, start, match)
        else:
            self._refused = 0
        self._match = match
        self._motion.moved(match.pose, scan)
        if self._due(points, match):  # 5.
            self._insert(points, match)
        return match.pose

    def insert_at(self, scan: Scan, pose: Pose2) -> None:
        """Take a scan whose pose is known, at rest; it enters the map unless `frozen`."""
        self._motion = Motion(self.params.start)
        self._motion.predict(pose, scan)
        self._motion.moved(pose, scan)
        self._match = Match(pose, 1.0, 0.0)
        points = self._scan.take(scan, IDENTITY)
        if points.n > 0 and not self.frozen:
            self._insert(points, self._match)

    def map(self) -> OccupancyGrid:
        """The finest level as probabilities."""
        return self._map.grid()

    def report(self) -> dict[str, Any]:
        """Counts of scans: empty, inserted, retried, searched, lost; with odometry, with gyro."""
        motion = {"odometry": self._motion.odometry, "gyro": self._motion.gyro}
        return self._counts | motion | self._map.extent.counts

    @property
    def quality(self) -> float:
        """Share of the last scan's beams that the map explains, 0..1 (1 where not computed)."""
        return self._match.share

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the last pose against the map [m^2, m rad, rad^2].

        The inverse of H times the beams' mean square.
        """
        noise = max(self._match.square, 1e-6)
        return np.asarray(noise * np.linalg.pinv(self._H, hermitian=True), np.float64)

    def _matched(self, points: EndPoints, start: Pose2) -> Match:
        """Step 3, on the lines."""
        if self._map.insertions == 0 or points.n == 0:
            return self._match._replace(pose=start)
        return Match(*self._map.fit(points, start, self._lines, self._H))

    def _coarse_to_fine(self, points: EndPoints, pose: Pose2) -> Pose2:
        for level, solver in self._solvers:
            pose = self._map.match(level, points, pose, solver, self._H)
        return pose

    def _doubtful(self, points: EndPoints, match: Match) -> bool:
        """Whether the start may be out of the lines' reach, or the map explains less than usual."""
        if self._map.insertions == 0 or points.n == 0:
            return False
        could_gain = self.params.acceleration * self._motion.dt**2
        wide = could_gain > 0.5 * self.params.resolution
        return wide or match.share < self.params.doubt * self._match.share

    def _recovered(self, points: EndPoints, start: Pose2, match: Match) -> Match:
        """Step 4: the best of other starts; if that is bad, of a search; if still, the start."""
        self._counts["retried"] += 1
        starts = [start, self._match.pose]
        tried = [match, *(self._matched(points, self._coarse_to_fine(points, s)) for s in starts)]
        best, evidence = self._best(points, tried)
        if evidence < self.params.lost:
            self._counts["searched"] += 1
            found = self._map.search(points, start)
            tried = [best, *(self._matched(points, self._coarse_to_fine(points, s)) for s in found)]
            best, evidence = self._best(points, tried)
        if evidence < self.params.lost:
            self._counts["lost"] += 1
            self._refused += 1
            return Match(start, self._match.share, match.square)
        self._refused = 0
        return self._matched(points, best.pose)

    def _best(self, points: EndPoints, tried: list[Match]) -> tuple[Match, float]:
        evidence = [self._map.evidence(points, match.pose) for match in tried]
        best = int(np.argmax(evidence))
        return tried[best], evidence[best]

    def _due(self, points: EndPoints, match: Match) -> bool:
        """Step 5: far enough from the last insertion, or much that the map did not explain."""
        if self.frozen or points.n == 0 or 0 < self._refused < self.params.patience:
            return False
        if self._map.insertions < self.params.settle:
            return True
        step = self._key.pose.between(match.pose)
        moved = math.hypot(step.x, step.y) > self.params.insert_distance
        turned = abs(step.theta) > self.params.insert_angle
        return moved or turned or match.share < self.params.doubt * self._key.share

    def _insert(self, points: EndPoints, match: Match) -> None:
        entered = self._map.insert(points, match.pose)
        self._key = match
        self._refused = 0
        self._counts["inserted"] += entered


def _solvers(params: HectorParams) -> list[tuple[int, Solver]]:
    """The levels, coarse to fine, each with its Gauss-Newton."""
    rest = (params.max_shift, params.max_turn, params.converged, params.damping)
    coarse, fine = Solver(params.steps_coarse, *rest), Solver(params.steps_fine, *rest)
    return [(level, coarse if level else fine) for level in reversed(range(params.levels))]


def _line_fit(params: HectorParams) -> Fit:
    """Gauss-Newton on the lines; the prior is weighed against one beam's noise."""
    noise = params.range_noise**2
    return Fit(
        params.steps_fine,
        params.converged,
        params.softness,
        noise / params.prior_xy**2,
        noise / params.prior_theta**2,
    )
