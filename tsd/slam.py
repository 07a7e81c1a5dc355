"""TSD SLAM: registration against one grid of truncated signed distances.

[May14] S. May, P. Koch, R. Koch, C. Merkl, C. Pfitzner, A. Nuechter: A Generalized 2D and 3D
Multi-Sensor Data Integration Approach based on Signed Distance Functions for Multi-Modal Robotic
Mapping, VMV 2014.
[Koch15] P. Koch, S. May, M. Schmidpeter, M. Kuehn, C. Pfitzner, C. Merkl, R. Koch, M. Fees,
J. Martin, A. Nuechter: Multi-Robot Localization and Mapping Based on Signed Distance Functions,
ICARSC 2015.

1. Predict: odometry, gyro or the last motion.
2. See: surface elements of the scan, with their normals.
3. Register the scan with the field: Gauss-Newton on its distances.
4. Refuse an implausible registration: the prediction stands and nothing is pushed.
5. Accept it.
6. Push the scan into the field when the robot has moved.

The published program, `tsd@original`, stands in `original`.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from slams.motion import Motion
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan
from tsd.direct import Direct
from tsd.fix import Fix, Start
from tsd.image import Picture, colored
from tsd.params import TsdParams

COUNTS = ("pushed", "searched", "rejected", "recovered", "empty", "restarted")
DOUBTFUL = 0.1  # odometry so far from the last motion [m], [rad] has stalled or jumped
JUMP, JUMP_TURN = 0.25, 0.35  # farther from the prediction [m], [rad] is no motion
SLIPPED = 0.8  # of a slip that is made good says nothing about the velocity
BLUR, BLUR_TURN = 0.002, 0.001  # in one sweep [m], [rad]: a better velocity is worth a second look


class Tsd:
    """SLAM on a field of truncated signed distances.

    Args:
        params: parameters.
    """

    Params: ClassVar[type[TsdParams]] = TsdParams

    def __init__(self, params: TsdParams) -> None:
        self.params = params
        self._registration = Direct(params, np.random.default_rng(params.seed))
        self._motion = Motion("auto")
        self._pose = self._pushed_at = IDENTITY
        self._velocity = IDENTITY
        self._fix = Fix.none(IDENTITY)
        self._lost = 0
        self._counts = dict.fromkeys(COUNTS, 0)

    def update(self, scan: Scan) -> Pose2:
        """Take the next scan; return the base's pose in the map."""
        start = self._predict(scan)  # 1
        self._velocity = self._motion.velocity
        if self._registration.see(scan, self._velocity) == 0:  # 2
            self._counts["empty"] += 1
            self._keep(scan, start.pose)
        elif self._counts["pushed"] == 0:
            self._keep(scan, start.pose)
            self._push()
        else:
            self._register(scan, start)
        half = 0.5 * _duration(scan)  # registered at its middle; the stamp is that of its start
        return self._pose @ _scaled(self._velocity, half).inverse()

    def _register(self, scan: Scan, start: Start) -> None:
        fix = self._registration.register(start)  # 3
        if fix.good and self._looks_again(scan, fix.pose):
            fix = self._registration.register(start._replace(pose=fix.pose))
        if not fix.good:
            self._refuse(scan, start.pose)  # 4
            return
        self._accept(scan, start, fix)  # 5
        if self._moved():
            self._push()  # 6

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
        motion = {"odometry": self._motion.odometry, "gyro": self._motion.gyro}
        return {**self._counts, **motion, "lost": self._lost, **self._registration.extent.counts}

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
        p, motion = self.params, self._motion
        pose = motion.predict(self._pose, scan)
        unmeasured = self._pose @ motion.step
        if not motion.measured:
            return Start(pose, p.prior_translation, p.prior_rotation, (self._pose, unmeasured))
        surprise = unmeasured.between(pose)  # odometry that stalls disagrees with the motion
        distance, turn = math.hypot(surprise.x, surprise.y), abs(surprise.theta)
        return Start(
            pose,
            0.5 * p.prior_translation + p.odometry_noise * (distance + 0.1 * turn),
            0.5 * p.prior_rotation + p.odometry_noise * turn,
            (self._pose, unmeasured),
            distance > DOUBTFUL or turn > DOUBTFUL,
        )

    def _looks_again(self, scan: Scan, pose: Pose2) -> bool:
        """See the scan anew with the velocity that was found, where that moves its points."""
        found, expected, seconds = self._motion.velocity_to(pose), self._velocity, _duration(scan)
        blur = seconds * math.hypot(found.x - expected.x, found.y - expected.y)
        if blur < BLUR and seconds * abs(found.theta - expected.theta) < BLUR_TURN:
            return False
        self._velocity = found
        return self._registration.see(scan, found) > 0

    def _accept(self, scan: Scan, start: Start, fix: Fix) -> None:
        surprise = start.pose.between(fix.pose)
        if math.hypot(surprise.x, surprise.y) < JUMP and abs(surprise.theta) < JUMP_TURN:
            x, y = (SLIPPED * s for s in fix.slip)
            self._motion.moved(Pose2(fix.pose.x - x, fix.pose.y - y, fix.pose.theta), scan)
        else:
            self._motion.missed(scan)
        self._counts["searched"] += fix.searched
        self._counts["recovered"] += self._lost > 0
        self._lost = 0
        self._fix, self._pose = fix, fix.pose

    def _refuse(self, scan: Scan, predicted: Pose2) -> None:
        """Stay with the prediction; after many scans without a match map on from there."""
        self._counts["rejected"] += 1
        self._lost += 1
        self._keep(scan, predicted)
        if self._lost % self.params.lost_scans == 0:
            self._counts["restarted"] += 1
            self._push()

    def _keep(self, scan: Scan, predicted: Pose2) -> None:
        self._motion.missed(scan)
        self._pose = predicted

    def _moved(self) -> bool:
        step = self._pushed_at.between(self._pose)
        far = math.hypot(step.x, step.y) > self.params.push_translation
        return far or abs(math.sin(step.theta)) > self.params.push_rotation

    def _push(self) -> None:
        self._counts["pushed"] += 1
        self._registration.push(self._pose)
        self._pushed_at = self._pose


def _duration(scan: Scan) -> float:
    """Time from the first to the last beam [s]."""
    return abs(scan.laser.time_increment) * (scan.laser.n_beams - 1)


def _scaled(velocity: Pose2, seconds: float) -> Pose2:
    return Pose2(velocity.x * seconds, velocity.y * seconds, velocity.theta * seconds)
