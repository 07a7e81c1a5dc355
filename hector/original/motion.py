"""Motion: how the base moves from one scan to the next, by odometry, gyro, or as it did before."""

from __future__ import annotations

import math

from slams.types import IDENTITY, Pose2, Scan, wrap_angle

LONGEST = 5.0  # times the last interval that a step is stretched to
MEMORY = 0.9  # of the mean errors of both predictions, and of the mean interval


class Motion:
    """Predicts the pose of the next scan.

    `source` is "last" (stands still), "velocity" (constant velocity, turn from the gyro where
    there is one) or "auto" (odometry where there is some, else velocity). `velocity` is the
    expected motion per second in the base frame, `dt` [s] the interval; `odometry` and `gyro` count
    their uses.

    Stamps of real logs can be so ragged that a step as long as the last one predicts better than
    a velocity: the one that did better of late is used.
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
        """The pose at `scan`, from `pose` at the scan before."""
        self._pose, before = pose, self._before
        if before is None:
            return pose
        self.dt = self._interval(scan.t - before.t)
        self._by_stamps = self._scaled_step()
        step, turn = self._continued(), self._by_gyro(before, scan)
        if turn is not None:
            step = step._replace(theta=turn)
        wheels = self._by_wheels(before, scan)
        if wheels is not None:
            step = wheels
        self.odometry += wheels is not None
        self.gyro += turn is not None and wheels is None
        self.velocity = _per_second(step, self.dt)
        return pose if self._source == "last" else pose @ step

    def moved(self, pose: Pose2, scan: Scan) -> None:
        """Learn the pose that was found for the scan."""
        step = self._pose.between(pose)
        self._error_by_stamps = _recent(self._error_by_stamps, step, self._by_stamps)
        self._error_by_count = _recent(self._error_by_count, step, self._last_step)
        self._last_step, self._step_dt = step, self.dt
        self._before = scan

    def velocity_to(self, pose: Pose2) -> Pose2:
        """Velocity of the base had it moved to `pose` since the scan before."""
        return _per_second(self._pose.between(pose), self.dt)

    def _by_wheels(self, before: Scan, scan: Scan) -> Pose2 | None:
        """The step by odometry, where it may be used and both scans have it."""
        if self._source != "auto" or before.odometry is None or scan.odometry is None:
            return None
        if not math.isfinite(sum(before.odometry) + sum(scan.odometry)):
            return None
        return before.odometry.between(scan.odometry)

    def _by_gyro(self, before: Scan, scan: Scan) -> float | None:
        """The turn [rad] by the gyro, where it may be used and both scans have it."""
        if self._source == "last" or before.yaw is None or scan.yaw is None:
            return None
        if not math.isfinite(scan.yaw - before.yaw):
            return None
        return float(wrap_angle(scan.yaw - before.yaw))

    def _continued(self) -> Pose2:
        """The last motion goes on, by its velocity or by its step."""
        trusted = self._error_by_stamps <= self._error_by_count
        return self._by_stamps if trusted else self._last_step

    def _scaled_step(self) -> Pose2:
        """The last step at the same velocity over the present interval."""
        if self._step_dt <= 0.0:
            return self._last_step
        return _scaled(self._last_step, min(LONGEST, self.dt / self._step_dt))

    def _interval(self, dt: float) -> float:
        """Time since the scan before [s]; the usual one where the stamps do not go forward."""
        self._mean_dt = MEMORY * self._mean_dt + (1.0 - MEMORY) * dt if self._mean_dt else dt
        return dt if dt > 0.0 else max(0.0, self._mean_dt)


def _recent(error: float, step: Pose2, predicted: Pose2) -> float:
    """Fading mean of how far a prediction was from the step that was found [m]."""
    miss = math.hypot(step.x - predicted.x, step.y - predicted.y)
    return MEMORY * error + (1.0 - MEMORY) * miss


def _scaled(step: Pose2, factor: float) -> Pose2:
    return Pose2(step.x * factor, step.y * factor, step.theta * factor)


def _per_second(step: Pose2, dt: float) -> Pose2:
    return _scaled(step, 1.0 / dt) if dt > 0.0 else IDENTITY
