"""What the robot did between two scans: odometry, its turn by a gyro where there is one."""

from __future__ import annotations

import math

import numpy as np

from gmapping.original.params import OriginalParams
from slams.types import IDENTITY, Floats, Pose2, Scan, wrap_angle

FARTHEST = 10.0  # m between two scans; an odometry that goes farther has jumped
ACROSS = 0.3  # share of a motion's noise along one axis that the other axis gets


class Motion:
    """Odometry and gyro, whichever a scan brings."""

    def __init__(self, params: OriginalParams) -> None:
        self.used = {"odometry": 0, "gyro": 0, "odometry_jumps": 0}
        self._params = params
        self._last: Scan | None = None
        self._moved = IDENTITY

    def step(self, scan: Scan) -> Pose2 | None:
        """The motion since the scan before; None if neither odometry nor gyro has measured it."""
        last, self._last = self._last, scan
        if last is None:
            return None if scan.odometry is None and scan.yaw is None else IDENTITY
        step = self._odometry(last, scan)
        self.used["odometry"] += step is not None
        if last.yaw is not None and scan.yaw is not None:
            turn = float(wrap_angle(scan.yaw - last.yaw))
            step = (step or self._moved)._replace(theta=turn)
            self.used["gyro"] += 1
        return step

    def learn(self, moved: Pose2) -> None:
        """Keep the motion that was found, for scans with a gyro alone."""
        self._moved = moved

    def noise(self, step: Pose2) -> Floats:
        """Deviation of a step (3,): [Grisetti07] original code, linear in the step."""
        p = self._params
        x, y, turn = abs(step.x), abs(step.y), abs(step.theta)
        sideways = p.way_per_turn * turn
        return np.array(
            [
                p.way_per_way * (x + ACROSS * y) + sideways,
                p.way_per_way * (y + ACROSS * x) + sideways,
                p.turn_per_turn * turn + p.turn_per_way * math.hypot(x, y),
            ]
        )

    def _odometry(self, last: Scan, scan: Scan) -> Pose2 | None:
        if last.odometry is None or scan.odometry is None:
            return None
        step = last.odometry.between(scan.odometry)
        if math.hypot(step.x, step.y) <= FARTHEST:
            return step
        self.used["odometry_jumps"] += 1
        return None
