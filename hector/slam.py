"""Hector SLAM: gradient scan matching on a pyramid of occupancy grids.

[Kohlbrecher11] S. Kohlbrecher, O. von Stryk, J. Meyer, U. Klingauf: A Flexible and Scalable SLAM
System with Full 3D Motion Estimation. IEEE SSRR 2011. Per scan:

1. Predict the pose; ours: with a covariance, from wheels, gyro and the last twist.
2. End points of the beams in the base frame (sec. IV-A); ours: deskewed.
3. Scan matching (sec. IV-B): Gauss-Newton on the occupancy, coarse to fine (sec. IV-C).
4. ours: Gauss-Newton on the lines inside the finest cells, from the results of 1 and of 3.
5. Take the match; ours: choose among these matches, those of a search, and the prediction.
6. If the robot has moved, insert the scan into every level (sec. IV-A).

What is ours in steps 1, 4 and 5 is in `slams.frontend` and `slams.refine`; `hector@paper` leaves
it out. The published program, `hector@original`, is in `hector/original`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from hector.map import LogOddsPyramid
from hector.params import HectorParams
from slams.frontend.confident import HasEstimator
from slams.frontend.keyframes import Keyframes
from slams.frontend.motion_filter import Prediction
from slams.frontend.plain import estimator_for
from slams.geometry import Prior
from slams.params import Params
from slams.refine.lines import Match
from slams.scan.end_points import EndPoints, pose_distance
from slams.types import IDENTITY, OccupancyGrid, Pose2, Scan


class Hector(HasEstimator):
    """Gradient scan matching on a grid pyramid; the module lists the steps.

    While `frozen` is set, no scan enters the map.
    """

    Params: ClassVar[type[Params]] = HectorParams

    def __init__(self, params: HectorParams) -> None:
        self.params = params
        self.frozen = False
        self._map = LogOddsPyramid(params)
        self._scan = EndPoints(params)
        self._estimator = estimator_for(params)
        self._keyframes = Keyframes(params.insert_distance, params.insert_angle, params.settle)
        self._counts = {"posed": 0, "kept": 0, "refined": 0, "inserted": 0}

    def update(self, scan: Scan) -> Pose2:
        """Match the scan to the map, insert it if due; return T_map_base."""
        prior = self._estimator.predict(scan)  # 1.
        points = self._scan.read(scan, prior.twist)  # 2.
        matches = self._match(points, prior.pose, prior)  # 3. and 4.
        if points.has_sweep:  # 2. to 4. again, with the twist of the match
            points = self._scan.read(scan, self._estimator.twist_at(matches[0].pose))
            matches = self._match(points, prior.pose, prior)
        pose = self._estimator.decide(points, matches, self._map, self._match)  # 5.
        self._learn_from_match(points, prior)
        quality, mount = self._estimator.quality, scan.laser.mount
        if self._estimator.may_map and self._keyframes.due(pose, quality, mount):
            self._insert(points, pose)  # 6.
        return points.at_stamp(pose)

    def insert_at(self, scan: Scan, pose: Pose2) -> None:
        """Insert a scan into the map at a known pose, without matching."""
        self._estimator.set_pose(scan, pose)
        self._insert(self._scan.read(scan, IDENTITY), pose)

    def adopt(self, other: Hector, pose: Pose2) -> None:
        """Continue in the map of another instance, at `pose` in it, with the present twist."""
        self._map, self._keyframes = other._map, other._keyframes
        self._estimator.correct(pose)

    def map(self) -> OccupancyGrid:
        """The finest level as probabilities of occupied."""
        return self._map.grid()

    def snapshot(self) -> Callable[[], OccupancyGrid]:
        """A function that returns the map of now, also after later updates."""
        return self._map.snapshot()

    def report(self) -> dict[str, Any]:
        """Numbers of scans.

        `posed`: matched by the pyramid; `kept`: the pose is within a cell of that match; `refined`:
        matched by the lines; `inserted` into the map; those of the estimator and the grid bounds.
        """
        counts = self._counts | self._estimator.counts | self._map.bounds.counts
        return counts | self._scan.counts

    def _match(self, points: EndPoints, start: Pose2, prior: Prediction) -> list[Match]:
        """Matches of steps 3 and 4 from a start."""
        if self._map.empty or points.n == 0:
            return [Match(start)]
        pose_prior = Prior(prior.pose, prior.information)
        coarse = self._map.climb(points, start, pose_prior)  # 3.
        matches = [coarse]
        if self.params.refine:
            matches = self._map.lines.refine(points, start, coarse.pose, pose_prior)  # 4.
        return [match._replace(coarse=coarse.pose) for match in matches]

    def _learn_from_match(self, points: EndPoints, prior: Prediction) -> None:
        """Update the residual variance of the lines and the counts by the match that was taken."""
        match = self._estimator.match
        if match is None or match.coarse is None:
            return
        self._map.lines.learn_variance(match, points, prior.wheels)
        self._counts["posed"] += 1
        self._counts["kept"] += (
            pose_distance(points, match.coarse, match.pose) < self.params.resolution
        )
        self._counts["refined"] += match.coarse != match.pose

    def _insert(self, points: EndPoints, pose: Pose2) -> None:
        """Insert the scan into the map, unless the map is frozen."""
        if self.frozen or points.n == 0:
            return
        self._counts["inserted"] += self._map.insert(points, pose)
        self._record_inserted(pose)
