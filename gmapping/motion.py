"""What the robot did between two scans, before the laser is asked."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gmapping.params import GMappingParams
from slams.types import IDENTITY, Floats, Pose2, Scan, wrap_angle

LONGEST = 1.0  # s; after a longer break the velocity is not trusted further
FASTEST = 10.0  # m/s; a faster odometry has jumped


class Step(NamedTuple):
    """Predicted motion of the base since the last scan.

    `pose` the motion; `deviation` (3,) of x, y [m], theta [rad]; `seconds` it took; `measured`
    whether odometry or a gyro says so; `velocity` the alternative: once more the last motion;
    `sweep` the motion in as many seconds while the beams were measured.
    """

    pose: Pose2
    deviation: Floats
    seconds: float
    measured: bool
    velocity: Pose2
    sweep: Pose2 = IDENTITY


class Motion:
    """Odometry, gyro, or the last motion again: whatever a scan brings and the mode allows."""

    def __init__(self, params: GMappingParams) -> None:
        mode = params.odometry
        self._params = params
        self._wheels = mode in ("auto", "odometry", "odometry+gyro")
        self._gyro = mode in ("auto", "gyro", "odometry+gyro")
        self._last: Scan | None = None
        self._velocity = IDENTITY
        self._period = 0.0
        self.used = {"odometry": 0, "gyro": 0, "odometry_jumps": 0}

    def step(self, scan: Scan) -> Step:
        """The motion since the scan before, with its noise."""
        last, self._last = self._last, scan
        if last is None:
            return Step(IDENTITY, np.zeros(3), 0.0, self._reads(scan), IDENTITY)
        seconds = self._elapsed(scan.t - last.t)
        wheels = self._odometry(last, scan, seconds)
        turn = self._turn(last, scan)
        pose = self._velocity if wheels is None else wheels
        deviation = self._drift(seconds) if wheels is None else self._noise(wheels)
        if turn is not None:
            pose = Pose2(pose.x, pose.y, turn)
            deviation[2] = self._params.rest_noise + self._params.gyro_noise * seconds
        self.used["odometry"] += wheels is not None
        self.used["gyro"] += turn is not None
        measured = wheels is not None or turn is not None
        return Step(pose, deviation, seconds, measured, self._velocity, pose)

    def rest(self, scan: Scan) -> Step:
        """The pose of this scan is given: the next step begins here, from rest."""
        self._last, self._velocity = scan, IDENTITY
        return Step(IDENTITY, np.zeros(3), 0.0, self._reads(scan), IDENTITY)

    def learn(self, moved: Pose2) -> None:
        """Keep the motion the laser found, to predict the next one."""
        self._velocity = moved

    def noise(self, way: Pose2) -> Floats:
        """Deviation (3,) of a whole way between two key scans: drawn once, whatever the rate."""
        return self._params.tracked_noise * self._noise(way) + self._params.key_noise

    def _reads(self, scan: Scan) -> bool:
        wheels = self._wheels and scan.odometry is not None
        return wheels or (self._gyro and scan.yaw is not None)

    def _elapsed(self, seconds: float) -> float:
        """Time since the last scan [s], at least the usual one: stamps come late or jump back."""
        seconds = min(max(seconds, 0.0), LONGEST)
        self._period += 0.1 * (seconds - self._period) if self._period else seconds
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

    def _noise(self, step: Pose2) -> Floats:
        p = self._params
        way, turn = math.hypot(step.x, step.y), abs(step.theta)
        xy = p.way_per_way * way + p.way_per_turn * turn + p.rest_noise
        theta = p.turn_per_way * way + p.turn_per_turn * turn + p.rest_noise
        return np.array([xy, xy, theta])

    def _drift(self, seconds: float) -> Floats:
        xy = self._params.acceleration * seconds * seconds + self._params.rest_noise
        return np.array([xy, xy, 2.0 * xy])
