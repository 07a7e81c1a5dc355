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

from slams.motion.model import Prediction
from slams.motion.track import Track
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan, State
from tsd.direct import Direct
from tsd.fix import Fix
from tsd.image import Picture, colored
from tsd.params import TsdParams

COUNTS = ("pushed", "searched", "rejected", "recovered", "empty", "restarted")
BLUR, BLUR_TURN = 0.002, 0.001  # in one sweep [m], [rad]: a better velocity is worth a second look


class Tsd:
    """SLAM on a field of truncated signed distances.

    Args:
        params: parameters.
    """

    Params: ClassVar[type[TsdParams]] = TsdParams

    def __init__(self, params: TsdParams) -> None:
        self.params = params
        self._track = Track(params, widen_wheels=True)
        self._registration = Direct(params, self._track, np.random.default_rng(params.seed))
        self._pushed_at = IDENTITY
        self._velocity = IDENTITY
        self._quality = 1.0
        self._counts = dict.fromkeys(COUNTS, 0)

    def update(self, scan: Scan) -> Pose2:
        """Take the next scan; return the base's pose in the map."""
        start = self._track.predict(scan)  # 1
        self._velocity = start.velocity
        if self._registration.see(scan, self._velocity) == 0:  # 2
            self._counts["empty"] += 1
            self._track.missed(scan)
        elif self._counts["pushed"] == 0:
            self._track.matched(start.pose, np.zeros((3, 3)), scan)
            self._push()
        else:
            self._register(scan, start)
        half = 0.5 * _duration(scan)  # registered at its middle; the stamp is that of its start
        return self._track.pose @ _scaled(self._velocity, half).inverse()

    def _register(self, scan: Scan, start: Prediction) -> None:
        before = self._track.pose
        others = (before, before @ start.continued)
        fix = self._registration.register(start.pose, others)  # 3
        if fix.good and self._looks_again(scan, fix.pose):
            fix = self._registration.register(fix.pose, others)
        self._quality = fix.quality
        if not fix.good:
            self._refuse(scan)  # 4
            return
        self._accept(scan, fix)  # 5
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
        counts = self._counts | {"lost": self._track.lost} | self._track.motion.counts
        return counts | self._registration.extent.counts

    @property
    def state(self) -> State:
        """How the last pose came about."""
        return self._track.state

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the last pose against the map [m2, m rad, rad2]."""
        return self._track.covariance

    @property
    def quality(self) -> float:
        """Share of the last scan that agrees with the map, 0 to 1."""
        return self._quality

    def _looks_again(self, scan: Scan, pose: Pose2) -> bool:
        """See the scan anew with the velocity that was found, where that moves its points."""
        found, seconds = self._track.motion.velocity_to(pose), _duration(scan)
        expected = self._velocity
        blur = seconds * math.hypot(found.x - expected.x, found.y - expected.y)
        if blur < BLUR and seconds * abs(found.theta - expected.theta) < BLUR_TURN:
            return False
        self._velocity = found
        return self._registration.see(scan, found) > 0

    def _accept(self, scan: Scan, fix: Fix) -> None:
        self._counts["searched"] += fix.searched
        self._counts["recovered"] += self._track.state != "matched"
        self._track.matched(fix.aligned, fix.information, scan)
        self._track.slipped(fix.pose, fix.doubt)

    def _refuse(self, scan: Scan) -> None:
        """Stay with the prediction; where wheels alone have held it for long, map on from there."""
        self._counts["rejected"] += 1
        self._track.missed(scan)
        if self._track.held and not self._registration.contradicts(self._track.pose):
            self._counts["restarted"] += 1
            self._push()

    def _moved(self) -> bool:
        step = self._pushed_at.between(self._track.pose)
        far = math.hypot(step.x, step.y) > self.params.push_translation
        return far or abs(math.sin(step.theta)) > self.params.push_rotation

    def _push(self) -> None:
        self._counts["pushed"] += 1
        self._registration.push(self._track.pose)
        self._pushed_at = self._track.pose


def _duration(scan: Scan) -> float:
    """Time from the first to the last beam [s]."""
    return abs(scan.laser.time_increment) * (scan.laser.n_beams - 1)


def _scaled(velocity: Pose2, seconds: float) -> Pose2:
    return Pose2(velocity.x * seconds, velocity.y * seconds, velocity.theta * seconds)
