"""What the robot did between two scans: odometry, its turn by a gyro where there is one."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gmapping.original.params import OriginalParams
from slams.types import IDENTITY, Floats, Pose2, Scan, wrap_angle

LONGEST = 1.0  # s between two scans, for the check of odometry and the time of a sweep
FASTEST = 10.0  # m/s; a faster odometry has jumped
USUAL = 0.1  # share of a scan in the mean interval
ACROSS = 0.3  # share of a motion's noise along one axis that the other axis gets


class Step(NamedTuple):
    """Motion `pose` of the base in `seconds`, and whether odometry or a gyro has `measured` it."""

    pose: Pose2
    seconds: float
    measured: bool


class Motion:
    """Odometry and gyro, whichever a scan brings and the mode allows."""

    def __init__(self, params: OriginalParams) -> None:
        mode = params.odometry
        self.used = {"odometry": 0, "gyro": 0, "odometry_jumps": 0}
        self._params = params
        self._wheels = mode in ("auto", "odometry", "odometry+gyro")
        self._gyro = mode in ("auto", "gyro", "odometry+gyro")
        self._last: Scan | None = None
        self._moved = IDENTITY
        self._period = 0.0

    def step(self, scan: Scan) -> Step:
        """The motion since the scan before."""
        last, self._last = self._last, scan
        if last is None:
            return Step(IDENTITY, 0.0, self._reads(scan))
        seconds = self._elapsed(scan.t - last.t)
        wheels, turn = self._odometry(last, scan, seconds), self._turn(last, scan)
        pose = self._moved if wheels is None else wheels
        if turn is not None:
            pose = Pose2(pose.x, pose.y, turn)
        self.used["odometry"] += wheels is not None
        self.used["gyro"] += turn is not None
        return Step(pose, seconds, wheels is not None or turn is not None)

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

    def _reads(self, scan: Scan) -> bool:
        wheels = self._wheels and scan.odometry is not None
        return wheels or (self._gyro and scan.yaw is not None)

    def _elapsed(self, seconds: float) -> float:
        """Time since the last scan [s], at least the usual one: stamps come late or jump back."""
        seconds = min(max(seconds, 0.0), LONGEST)
        self._period += USUAL * (seconds - self._period) if self._period else seconds
        return max(seconds, self._period)

    def _odometry(self, last: Scan, scan: Scan, seconds: float) -> Pose2 | None:
        if not self._wheels or last.odometry is None or scan.odometry is None:
            return None
        step = last.odometry.between(scan.odometry)
        if math.hypot(step.x, step.y) <= FASTEST * max(seconds, LONGEST):
            return step
        self.used["odometry_jumps"] += 1
        return None

    def _turn(self, last: Scan, scan: Scan) -> float | None:
        if not self._gyro or last.yaw is None or scan.yaw is None:
            return None
        turn = float(wrap_angle(scan.yaw - last.yaw))
        return turn if math.isfinite(turn) else None
