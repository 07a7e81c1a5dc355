"""PlainEstimator: the mechanism of a paper alone, without the front end."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from slams.frontend.estimator import PoseEstimator
from slams.frontend.motion_filter import ZERO_VELOCITY_STD, Prediction
from slams.frontend.params import FrontendParams
from slams.frontend.ranking import MatchedMap, Rematch
from slams.frontend.wheels import is_reset
from slams.refine.lines import Match
from slams.scan.end_points import EndPoints
from slams.types import IDENTITY, Floats, Pose2, Scan, State

UNINFORMED = np.zeros((3, 3))  # information of a prior that a paper does not have
MAX_STAMP_ERROR = 0.2  # s, to bound the step that wheels can have driven


class PlainEstimator:
    """Predicts by wheels, gyro or the last step, and takes the last match.

    It has the interface of `PoseEstimator`, without filter, gate and search. A paper whose match
    has a `motion_model` of the wheels as its prior gets the information of the wheels.
    """

    def __init__(self, params: FrontendParams, motion_model: bool = False) -> None:
        self.state: State = "matched"
        self.quality, self.may_map = 1.0, False
        self.match: Match | None = None
        self.pose = IDENTITY
        self.covariance = self.local_covariance = np.diag([math.inf] * 3)
        names = "empty", "matched", "predicted", "lost", "odometry", "gyro"
        self.counts = dict.fromkeys(names, 0)
        self._p, self._motion_model = params, motion_model
        self._last_scan: Scan | None = None
        self._twist, self._step, self._dt = IDENTITY, IDENTITY, 0.0

    def predict(self, scan: Scan) -> Prediction:
        """Predict the pose by the step of the wheels, or by the last step."""
        scan = scan.at_mid_sweep
        last, self._last_scan = self._last_scan, scan
        self._dt = 0.0 if last is None else max(scan.t - last.t, 0.0)
        step = self._step  # not twist times interval: stamps jitter more than steps do
        information = UNINFORMED
        if last is not None and last.odometry and scan.odometry and self._p.wheels:
            measured = last.odometry.between(scan.odometry)
            information = self._information(measured) if self._motion_model else UNINFORMED
            # at a reset the last step is repeated, with little information, as the jump is long
            if not is_reset(measured, max(self._dt, MAX_STAMP_ERROR)):
                step = measured
                self.counts["odometry"] += 1
        if last is not None and last.yaw is not None and scan.yaw is not None and self._p.gyro:
            step = step._replace(theta=scan.yaw - last.yaw)
            self.counts["gyro"] += 1
        self._step, self._last_pose, self.pose = step, self.pose, self.pose @ step
        return Prediction(self.pose, information, UNINFORMED, self._twist, self._dt)

    def _information(self, step: Pose2) -> Floats:
        """Information (3, 3) of a step of the wheels [Thrun05] 5.4, equal in all directions."""
        p, distance, rotation = self._p, math.hypot(step.x, step.y), abs(step.theta)
        rest = ZERO_VELOCITY_STD**2
        xy = rest + p.slip**2 * distance + p.slip_sideways**2 * rotation
        heading = rest + p.slip_sideways**2 * distance + p.slip_rotation**2 * rotation
        return np.diag((1.0 / xy, 1.0 / xy, 1.0 / heading))

    def twist_at(self, pose: Pose2) -> Pose2:
        """The body twist [m/s, rad/s] that leads to `pose`."""
        step = self._last_pose.between(pose)
        return Pose2(*(v / self._dt for v in step)) if self._dt else IDENTITY

    def set_pose(self, scan: Scan, pose: Pose2) -> None:
        """Take a pose that is given with its scan."""
        self._last_scan, self.pose = scan.at_mid_sweep, pose
        self._twist = self._step = IDENTITY

    def correct(self, pose: Pose2) -> None:
        """Take a pose in a map that has changed; the motion stays."""
        self.pose = pose

    def inserted(self, settling: bool) -> None:
        """Nothing to record: this estimator has no covariance."""

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
            self._twist, self._step = self.twist_at(self.pose), self._last_pose.between(self.pose)
        return self.pose


def estimator_for(
    params: FrontendParams, motion_model: bool = False
) -> PoseEstimator | PlainEstimator:
    """The estimator that the parameters select; `motion_model` as in `PlainEstimator`."""
    if params.estimator == "plain":
        return PlainEstimator(params, motion_model)
    return PoseEstimator(params)
