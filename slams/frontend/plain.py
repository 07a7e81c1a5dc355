"""PlainEstimator: a paper's mechanism alone, without the front end."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from slams.frontend.estimator import PoseEstimator
from slams.frontend.motion_filter import TICK, Prediction
from slams.frontend.params import FrontendParams
from slams.frontend.ranking import MatchedMap, Rematch
from slams.frontend.wheels import is_reset
from slams.refine.lines import Match
from slams.scan.end_points import EndPoints
from slams.types import IDENTITY, Floats, Pose2, Scan, State

NOTHING = np.zeros((3, 3))
JITTER = 0.2  # s by which stamps may err: so long a step is taken that wheels can have driven


class PlainEstimator:
    """Prediction by wheels, gyro or the last step, and the last match: a paper's mechanism alone.

    The same interface as `PoseEstimator`; nothing is weighed, refused or searched. A paper whose
    match has a `motion_model` of the wheels as its prior gets their information.
    """

    def __init__(self, params: FrontendParams, motion_model: bool = False) -> None:
        self.state: State = "matched"
        self.quality, self.may_map = 1.0, False
        self.match: Match | None = None
        self.pose = IDENTITY
        self.covariance = self.local_covariance = np.diag([math.inf] * 3)
        self.counts = {
            "empty": 0,
            "matched": 0,
            "predicted": 0,
            "lost": 0,
            "odometry": 0,
            "gyro": 0,
        }
        self._p, self._motion_model = params, motion_model
        self._last: Scan | None = None
        self._twist, self._step, self._dt = IDENTITY, IDENTITY, 0.0

    def predict(self, scan: Scan) -> Prediction:
        """The pose by wheels, or by the last step once more."""
        last, self._last = self._last, scan
        self._dt = 0.0 if last is None else max(scan.t - last.t, 0.0)
        step = self._step  # not twist times interval: stamps jitter, steps hardly do
        information = NOTHING
        if last is not None and last.odometry and scan.odometry and self._p.wheels:
            driven = last.odometry.between(scan.odometry)
            information = self._information(driven) if self._motion_model else NOTHING
            # a reset leaves the last step; so far a jump says little of it
            if not is_reset(driven, max(self._dt, JITTER)):
                step = driven
                self.counts["odometry"] += 1
        if last is not None and last.yaw is not None and scan.yaw is not None and self._p.gyro:
            step = step._replace(theta=scan.yaw - last.yaw)
            self.counts["gyro"] += 1
        self._step, self._before, self.pose = step, self.pose, self.pose @ step
        return Prediction(self.pose, information, NOTHING, self._twist, self._dt)

    def _information(self, step: Pose2) -> Floats:
        """Of a step (3, 3) that wheels measured: [Thrun05] 5.4, alike in every direction."""
        p, way, turn = self._p, math.hypot(step.x, step.y), abs(step.theta)
        place = TICK**2 + p.slip**2 * way + p.slip_sideways**2 * turn
        heading = TICK**2 + p.slip_sideways**2 * way + p.slip_rotation**2 * turn
        return np.diag((1.0 / place, 1.0 / place, 1.0 / heading))

    def twist_at(self, pose: Pose2) -> Pose2:
        """The twist that leads to `pose`."""
        return Pose2(*(v / self._dt for v in self._before.between(pose))) if self._dt else IDENTITY

    def place(self, scan: Scan, pose: Pose2) -> None:
        """The pose of a scan is known."""
        self._last, self.pose, self._twist, self._step = scan, pose, IDENTITY, IDENTITY

    def correct(self, pose: Pose2) -> None:
        """The map has changed, and the robot is at `pose` in it; it moves as before."""
        self.pose = pose

    def inserted(self, settling: bool) -> None:
        """The last scan has entered the map: nothing is known of its noise."""

    def decide(
        self, points: EndPoints, matches: Sequence[Match], grid: MatchedMap, rematch: Rematch
    ) -> Pose2:
        """Take the last match."""
        self.counts["empty"] += points.n == 0
        self.may_map = points.n > 0
        self.state = "matched" if self.may_map else "predicted"
        self.counts[self.state] += 1
        self.match = matches[-1] if self.may_map else None
        if self.may_map:
            self.pose, self.quality = matches[-1].pose, min(matches[-1].inlier_ratio, 1.0)
            self._twist, self._step = self.twist_at(self.pose), self._before.between(self.pose)
        return self.pose


def estimator_for(
    params: FrontendParams, motion_model: bool = False
) -> PoseEstimator | PlainEstimator:
    """The estimator that the parameters name; `motion_model` as in `PlainEstimator`."""
    if params.estimator == "plain":
        return PlainEstimator(params, motion_model)
    return PoseEstimator(params)
