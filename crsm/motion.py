"""Motion: where the robot may be by now, from all that is known without the scan."""

from __future__ import annotations

import math

from slams.types import IDENTITY, Pose2, Scan

LONGEST_STEP = 5.0  # m; more between two scans is a fault of the odometry
LONGEST_TIME = 1.0  # s between two scans for a velocity to mean something


class Motion:
    """The last step, and odometry and gyro where the scans bring them."""

    def __init__(self) -> None:
        self.counts = {"odometry": 0, "gyro": 0}
        self.step = IDENTITY
        self.velocity = IDENTITY
        self.is_measured = False
        self._last: Scan | None = None

    def predictions(self, pose: Pose2, scan: Scan) -> list[Pose2]:
        """Poses to start from, the most trusted first: odometry, gyro, same step again, rest."""
        steps = [self.step]
        turn = self._turned(scan)
        if turn is not None:
            steps.insert(0, Pose2(self.step.x, self.step.y, turn))
            self.counts["gyro"] += 1
        measured = self._measured(scan)
        self.is_measured = measured is not None
        if measured is not None:
            steps.insert(0, measured)
            self.counts["odometry"] += 1
        return [pose @ step for step in steps]

    def moved(self, step: Pose2, scan: Scan) -> None:
        """The robot made `step` until this scan."""
        self.step = step
        self.velocity = self.velocity_of(step, scan)
        self._last = scan

    def velocity_of(self, step: Pose2, scan: Scan) -> Pose2:
        """Velocity [m/s, rad/s] of a robot that makes `step` until this scan."""
        duration = math.inf if self._last is None else scan.t - self._last.t
        if not 0.0 < duration < LONGEST_TIME:
            return IDENTITY
        return Pose2(*(v / duration for v in step))

    def _measured(self, scan: Scan) -> Pose2 | None:
        """The step by odometry since the last scan, if both had it and it is possible."""
        before = None if self._last is None else self._last.odometry
        now = scan.odometry
        if before is None or now is None or not all(map(math.isfinite, (*before, *now))):
            return None
        step = before.between(now)
        return step if math.hypot(step.x, step.y) < LONGEST_STEP else None

    def _turned(self, scan: Scan) -> float | None:
        """The turn by gyro since the last scan."""
        before = None if self._last is None else self._last.yaw
        if before is None or scan.yaw is None or not math.isfinite(scan.yaw - before):
            return None
        return math.remainder(scan.yaw - before, 2.0 * math.pi)


class Pace:
    """Something is due at once, then again after `step` [m or rad] or after `rest` scans."""

    def __init__(self, step: float, rest: int) -> None:
        self._step, self._rest = step, rest
        self._at: Pose2 | None = None
        self._scans = 0

    def is_due(self, pose: Pose2) -> bool:
        """Whether it is due at this scan, taken at `pose`."""
        self._scans += 1
        if self._at is None or self._scans >= self._rest:
            return True
        step = self._at.between(pose)
        return max(math.hypot(step.x, step.y), abs(step.theta)) >= self._step

    def done(self, pose: Pose2) -> None:
        """It was done at `pose`."""
        self._at, self._scans = pose, 0
