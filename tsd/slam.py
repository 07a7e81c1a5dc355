"""TSD SLAM: registration against one grid of truncated signed distances.

[May14] S. May, P. Koch, R. Koch, C. Merkl, C. Pfitzner, A. Nuechter: A Generalized 2D and 3D
Multi-Sensor Data Integration Approach based on Signed Distance Functions for Multi-Modal Robotic
Mapping, VMV 2014.
[Koch15] P. Koch, S. May, M. Schmidpeter, M. Kuehn, C. Pfitzner, C. Merkl, R. Koch, M. Fees,
J. Martin, A. Nuechter: Multi-Robot Localization and Mapping Based on Signed Distance Functions,
ICARSC 2015. Per scan:

1. Predict the pose; ours: with a covariance, from wheels, gyro and the recent motion.
2. Fit surface elements with normals to the scan; ours: after deskewing the sweep.
3. Register the scan to a model scan, cast from the map at the predicted pose: by ICP [May14], and
   by RANSAC and ICP [Koch15]; ours: RANSAC only if prediction or ICP are uncertain.
4. ours: refine the pose by Gauss-Newton on the signed distances.
5. Take the match; ours: select among matches, poses of a search, and the prediction.
6. If the robot has moved, push the scan into the field [May14].

What is ours is `slams.frontend` and step 4. `tsd@paper` leaves out both. The published program,
`tsd@original`, is in the folder `original`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from slams.frontend.confident import HasEstimator
from slams.frontend.keyframes import Keyframes
from slams.frontend.motion_filter import Prediction
from slams.frontend.plain import estimator_for
from slams.geometry import Prior
from slams.refine.lines import Match
from slams.scan.end_points import EndPoints, pose_distance
from slams.types import IDENTITY, OccupancyGrid, Pose2, Scan
from tsd.map import TileField
from tsd.params import TsdParams
from tsd.registration import Registration
from tsd.scan import SurfaceScan


class Tsd(HasEstimator):
    """SLAM on a field of truncated signed distances; see the module for the steps.

    `frozen`: if set, scans do not enter the map.
    """

    Params: ClassVar[type[TsdParams]] = TsdParams

    def __init__(self, params: TsdParams) -> None:
        self.params = params
        self.frozen = False
        self._map = TileField(params)
        self._scan = SurfaceScan(params)
        rng = np.random.default_rng(params.seed)
        self._registration = Registration(params, self._map, rng)
        self._estimator = estimator_for(params)
        self._keyframes = Keyframes(params.push_translation, params.push_rotation, 1)
        self._counts = {"posed": 0, "kept": 0, "refined": 0, "inserted": 0}

    def update(self, scan: Scan) -> Pose2:
        """Match the scan to the map, push it if due; return T_map_base."""
        prior = self._estimator.predict(scan)  # 1.
        points = self._scan.read(scan, prior.twist)  # 2.
        matches = self._match(points, prior.pose, prior)
        if points.has_sweep:  # 2. again, deskewed with the matched motion
            points = self._scan.read(scan, self._estimator.twist_at(matches[0].pose))
            matches = self._match(points, prior.pose, prior)
        pose = self._estimator.decide(points, matches, self._map, self._match)  # 5.
        self._learn(points)
        quality, mount = self._estimator.quality, scan.laser.mount
        if self._estimator.may_map and self._keyframes.due(pose, quality, mount):
            self._insert(points, pose)  # 6.
        return points.at_stamp(pose)

    def insert_at(self, scan: Scan, pose: Pose2) -> None:
        """Push a scan at a known pose, without matching."""
        self._estimator.set_pose(scan, pose)
        self._insert(self._scan.read(scan, IDENTITY), pose)

    def adopt(self, other: Tsd, pose: Pose2) -> None:
        """Continue in the map of another instance at `pose`, with the same motion."""
        self._map, self._keyframes = other._map, other._keyframes
        self._registration = other._registration
        self._estimator.correct(pose)

    def map(self) -> OccupancyGrid:
        """The present map."""
        return self._map.grid()

    def snapshot(self) -> Callable[[], OccupancyGrid]:
        """A function that draws the present map, also while updates go on."""
        return self._map.snapshot().draw

    def report(self) -> dict[str, Any]:
        """Counts of scans.

        `posed`: matched by ICP; `kept`: pose taken within a cell of ICP's; `refined` on the field;
        `inserted`; and the counts of the estimator, the map's bounds and the scan.
        """
        counts = self._counts | self._estimator.counts | self._map.extent.counts
        return counts | self._scan.counts

    def _match(self, points: EndPoints, start: Pose2, prior: Prediction) -> list[Match]:
        """Steps 3 and 4 from a start."""
        scan, expected = self._scan, Prior(prior.pose, prior.information)
        if self._map.empty or scan.count == 0:
            return [Match(start)]
        coarse = self._registration.match(scan, start, prior)  # 3.
        found = self._refine(start, coarse, expected) if self.params.refine else [coarse]  # 4.
        return [match._replace(coarse=coarse.pose) for match in found]

    def _refine(self, start: Pose2, coarse: Match, prior: Prior) -> list[Match]:
        """Gauss-Newton on the field from the start of ICP and, if far from there, from its end."""
        scan, cell = self._scan, self.params.cell
        found = [self._map.align(scan, start, prior)]
        if pose_distance(scan, coarse.pose, found[0].pose) > cell:
            found.append(self._map.align(scan, coarse.pose, prior))
        return found

    def _learn(self, points: SurfaceScan) -> None:
        """Count how the selected match was found, and learn the field's error from it."""
        match = self._estimator.match
        if match is None or match.coarse is None:
            return
        self._map.learn(match)
        self._counts["posed"] += 1
        self._counts["kept"] += pose_distance(points, match.coarse, match.pose) < self.params.cell
        self._counts["refined"] += match.coarse != match.pose

    def _insert(self, points: SurfaceScan, pose: Pose2) -> None:
        if self.frozen or points.n == 0:
            return
        self._counts["inserted"] += self._map.insert(points, pose)
        self._record_inserted(pose)
