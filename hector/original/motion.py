"""Motion: predicts the pose of the next scan by odometry, gyro or the last step."""

from __future__ import annotations

import math

from slams.types import IDENTITY, Pose2, Scan, wrap_angle

MAX_STEP_SCALE = 5.0  # 1; of the last step, for an interval longer than the last
FORGETTING_FACTOR = 0.9  # 1; weight of the old mean of intervals and errors, at each scan


class Motion:
    """Predicts the pose of the next scan; ours but for "last", which is the program's.

    `source` is "last" (the robot stands still), "velocity" (constant velocity, with the rotation
    from the gyro if there is one) or "auto" (odometry if there is some, else velocity). `velocity`
    [m/s, rad/s] is the predicted motion in the base frame, `dt` [s] the scan interval; `odometry`
    and `gyro` count the scans that used them.

    The stamps of some logs jitter so much that the last step predicts better than the last
    velocity. The one with the smaller recent error is used.
    """

    def __init__(self, source: str) -> None:
        self.odometry = 0
        self.gyro = 0
        self.velocity = IDENTITY
        self.dt = 0.0
        self._source = source
        self._pose = IDENTITY
        self._last_step = self._by_stamps = IDENTITY
        self._step_dt = self._mean_dt = 0.0
        self._error_by_stamps = self._error_by_count = 0.0
        self._before: Scan | None = None

    def predict(self, pose: Pose2, scan: Scan) -> Pose2:
        """Pose at `scan`, from the `pose` at the scan before."""
        self._pose, before = pose, self._before
        if before is None:
            return pose
        self.dt = self._interval(scan.t - before.t)
        self._by_stamps = self._scaled_step()
        step, rotation = self._repeated_step(), self._by_gyro(before, scan)
        if rotation is not None:
            step = step._replace(theta=rotation)
        wheels = self._by_wheels(before, scan)
        if wheels is not None:
            step = wheels
        self.odometry += wheels is not None
        self.gyro += rotation is not None and wheels is None
        self.velocity = _per_second(step, self.dt)
        return pose if self._source == "last" else pose @ step

    def correct(self, pose: Pose2, scan: Scan) -> None:
        """Set the pose that was matched for the scan."""
        step = self._pose.between(pose)
        self._error_by_stamps = _updated_error(self._error_by_stamps, step, self._by_stamps)
        self._error_by_count = _updated_error(self._error_by_count, step, self._last_step)
        self._last_step, self._step_dt = step, self.dt
        self._before = scan

    def velocity_to(self, pose: Pose2) -> Pose2:
        """Velocity [m/s, rad/s] that leads to `pose` since the scan before."""
        return _per_second(self._pose.between(pose), self.dt)

    def _by_wheels(self, before: Scan, scan: Scan) -> Pose2 | None:
        """The step by odometry, None if the source excludes it or a scan lacks it."""
        if self._source != "auto" or before.odometry is None or scan.odometry is None:
            return None
        if not math.isfinite(sum(before.odometry) + sum(scan.odometry)):
            return None
        return before.odometry.between(scan.odometry)

    def _by_gyro(self, before: Scan, scan: Scan) -> float | None:
        """The rotation [rad] by the gyro, None if the source excludes it or a scan lacks it."""
        if self._source == "last" or before.yaw is None or scan.yaw is None:
            return None
        if not math.isfinite(scan.yaw - before.yaw):
            return None
        return float(wrap_angle(scan.yaw - before.yaw))

    def _repeated_step(self) -> Pose2:
        """The last step at the same velocity, or unchanged where that has predicted better."""
        stamps_are_better = self._error_by_stamps <= self._error_by_count
        return self._by_stamps if stamps_are_better else self._last_step

    def _scaled_step(self) -> Pose2:
        """The last step, scaled to the present interval at the same velocity."""
        if self._step_dt <= 0.0:
            return self._last_step
        return _scaled(self._last_step, min(MAX_STEP_SCALE, self.dt / self._step_dt))

    def _interval(self, dt: float) -> float:
        """Time since the scan before [s]; the mean interval where stamps do not increase."""
        keep = FORGETTING_FACTOR
        self._mean_dt = keep * self._mean_dt + (1.0 - keep) * dt if self._mean_dt else dt
        return dt if dt > 0.0 else max(0.0, self._mean_dt)


def _updated_error(error: float, step: Pose2, predicted: Pose2) -> float:
    """Moving average of the distance [m] between predicted and matched steps."""
    distance = math.hypot(step.x - predicted.x, step.y - predicted.y)
    return FORGETTING_FACTOR * error + (1.0 - FORGETTING_FACTOR) * distance


def _scaled(step: Pose2, factor: float) -> Pose2:
    return Pose2(step.x * factor, step.y * factor, step.theta * factor)


def _per_second(step: Pose2, dt: float) -> Pose2:
    return _scaled(step, 1.0 / dt) if dt > 0.0 else IDENTITY
