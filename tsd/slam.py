"""TSD SLAM: registration against one grid of truncated signed distances.

[May14] S. May, P. Koch, R. Koch, C. Merkl, C. Pfitzner, A. Nuechter: A Generalized 2D and 3D
Multi-Sensor Data Integration Approach based on Signed Distance Functions for Multi-Modal Robotic
Mapping, VMV 2014.
[Koch15] P. Koch, S. May, M. Schmidpeter, M. Kuehn, C. Pfitzner, C. Merkl, R. Koch, M. Fees,
J. Martin, A. Nuechter: Multi-Robot Localization and Mapping Based on Signed Distance Functions,
ICARSC 2015.

1. See: points (default: surface elements with their normals) of the scan.
2. Predict: odometry, gyro or the last motion (original: the last pose).
3. Register the scan with the grid (default: Gauss-Newton on the field; original: ray cast of a
   model scan, RANSAC pre-registration, ICP).
4. Refuse an implausible registration: the prediction stands and nothing is pushed.
5. Accept it.
6. Push the scan into the grid when the robot has moved.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan, wrap_angle
from tsd.direct import Direct
from tsd.fix import Fix, Start
from tsd.grid import Picture, colored
from tsd.params import TsdParams
from tsd.published import Published

COUNTS = ("pushed", "odometry", "gyro", "searched", "rejected", "recovered", "empty", "restarted")
DOUBTFUL = 0.1  # odometry so far from the last motion [m], [rad] has stalled or jumped


class Tsd:
    """SLAM on a grid of truncated signed distances.

    Args:
        params: parameters; `TsdParams.preset("original")` for the published behavior.
    """

    Params: ClassVar[type[TsdParams]] = TsdParams

    def __init__(self, params: TsdParams) -> None:
        self.params = params
        rng = np.random.default_rng(params.seed)
        self._registration = (
            Direct(params) if params.registration == "direct" else Published(params, rng)
        )
        self._pose = self._pushed_at = IDENTITY
        self._step = self._velocity = IDENTITY
        self._last: Scan | None = None
        self._fix = Fix.none(IDENTITY)
        self._lost = 0
        self._counts = dict.fromkeys(COUNTS, 0)

    def update(self, scan: Scan) -> Pose2:
        """Take the next scan; return the base's pose in the map."""
        pose = self._follow(scan)
        half = 0.5 * scan.laser.time_increment * (scan.laser.n_beams - 1)
        if half == 0.0 or self._counts["pushed"] == 0:
            return pose
        v = self._velocity  # a scan that takes time is registered at its middle
        return pose @ Pose2(v.x * half, v.y * half, v.theta * half).inverse()

    def _follow(self, scan: Scan) -> Pose2:
        self._velocity = self._twist(scan)
        seen = self._registration.see(scan, self._velocity)  # 1
        start = self._predict(scan)  # 2
        self._last = scan
        if seen == 0:
            self._counts["empty"] += 1
            return self._keep(start.pose)
        if self._counts["pushed"] == 0:
            self._pose = start.pose
            return self._push()
        fix = self._registration.register(start)  # 3
        if not fix.good:
            return self._refuse(start.pose)  # 4
        self._accept(start, fix)  # 5
        if self._moved():
            self._push()  # 6
        return self._pose

    def map(self) -> OccupancyGrid:
        """The map as it stands now."""
        return self._registration.occupancy()

    def field(self) -> Picture:
        """The field itself: distances [m] (ny, nx), weights, edge of a cell, corner (x, y) [m]."""
        return self._registration.picture()

    def pictures(self) -> dict[str, NDArray[np.uint8]]:
        """File name to image (ny, nx, 3), blue, green, red: the field with both its sides."""
        tsd = self.field()[0]
        return {"map_tsd.png": colored(tsd, self.params.truncation)}

    def report(self) -> dict[str, Any]:
        """Counts of what happened so far."""
        return {**self._counts, "lost": self._lost}

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the last registered pose [m2, m rad, rad2], inf = not known."""
        return self._fix.covariance

    @property
    def quality(self) -> float:
        """Share of the last scan that agrees with the map, 0 to 1."""
        return self._fix.quality

    def _predict(self, scan: Scan) -> Start:
        """The pose expected now and how sure that is."""
        p, last = self.params, self._last
        if not p.prediction or last is None:
            return Start(self._pose, p.prior_translation, p.prior_rotation, ())
        others = (self._pose, self._pose @ self._step)
        if scan.odometry is not None and last.odometry is not None:
            self._counts["odometry"] += 1
            step = last.odometry.between(scan.odometry)
            surprise = self._step.between(step)  # odometry that stalls disagrees with the motion
            distance, turn = math.hypot(surprise.x, surprise.y), abs(surprise.theta)
            deviation = 0.5 * p.prior_translation + p.odometry_noise * (distance + 0.1 * turn)
            turn_deviation = 0.5 * p.prior_rotation + p.odometry_noise * turn
            doubtful = distance > DOUBTFUL or turn > DOUBTFUL
            return Start(self._pose @ step, deviation, turn_deviation, others, doubtful)
        step = self._step
        if scan.yaw is not None and last.yaw is not None:
            self._counts["gyro"] += 1
            step = Pose2(step.x, step.y, wrap_angle(scan.yaw - last.yaw))
        return Start(self._pose @ step, p.prior_translation, p.prior_rotation, others)

    def _twist(self, scan: Scan) -> Pose2:
        """Velocity [m/s, rad/s] of the last step, zero when the stamps do not tell."""
        dt = 0.0 if self._last is None else scan.t - self._last.t
        if not 1e-3 < dt < 1.0:
            return IDENTITY
        return Pose2(self._step.x / dt, self._step.y / dt, self._step.theta / dt)

    def _accept(self, start: Start, fix: Fix) -> None:
        surprise = start.pose.between(fix.pose)
        if math.hypot(surprise.x, surprise.y) < 0.25 and abs(surprise.theta) < 0.35:
            self._step = self._pose.between(fix.pose)  # a larger jump is no motion
        self._counts["searched"] += fix.searched
        self._counts["recovered"] += self._lost > 0
        self._lost = 0
        self._fix, self._pose = fix, fix.pose

    def _refuse(self, predicted: Pose2) -> Pose2:
        """Stay with the prediction; after many scans without a match map on from there."""
        self._counts["rejected"] += 1
        self._lost += 1
        self._keep(predicted)
        if self._lost % self.params.lost_scans == 0 and self.params.prediction:
            self._counts["restarted"] += 1
            return self._push()
        return self._pose

    def _keep(self, predicted: Pose2) -> Pose2:
        step = self._step
        self._step = Pose2(0.7 * step.x, 0.7 * step.y, 0.7 * step.theta)
        self._pose = predicted
        return predicted

    def _moved(self) -> bool:
        step = self._pushed_at.between(self._pose)
        far = math.hypot(step.x, step.y) > self.params.push_translation
        return far or abs(math.sin(step.theta)) > self.params.push_rotation

    def _push(self) -> Pose2:
        self._counts["pushed"] += 1
        self._registration.push(self._pose)
        self._pushed_at = self._pose
        return self._pose
