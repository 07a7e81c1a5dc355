"""Leveling: projects end points of a tilted laser to the plane and checks the attitudes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.scan.scan_kernels import Points
from slams.scan.tilt_kernels import Floor, level
from slams.types import Attitude, Floats, Laser, Pose2, Scan

ATTITUDE_ERROR = math.radians(0.6)  # rad: two deviations of a good attitude reference
FLOOR_CLEARANCE = 0.05  # m above or below a level floor: bumps, and the width of a beam
RAMP_HEIGHT = 0.2  # m that ramps rise and fall, from the floor under the robot
MIN_RAMP_SHARE = 0.1  # of the floor's end points below a level floor: the ground has ramps
MAX_ROBOT_TILT = math.radians(50.0)  # rad: beyond it the robot fell or the IMU hangs overhead
MAX_TILT_RATE = 1.0  # rad/s of a robot that tips over a step
MAX_TILT_STEP = math.radians(3.0)  # rad from scan to scan in addition: noise and latency
STUCK_TIME, STUCK_SCANS = 0.5, 4  # s, scans: the attitude of a moving robot changes sooner
MIN_MOVING_SPEED = 0.05  # m/s or rad/s of a robot that moves
FLOOR_MEMORY, MIN_FLOOR_POINTS = 400.0, 50.0  # recent end points on the floor: averaged, required
# shares of them below the floor that reject an attitude, and accept it again; latency causes 1/3
REJECTED_BELOW_SHARE, ACCEPTED_BELOW_SHARE = 0.4, 0.1
ATTITUDE_RECOVERY_TIME = 10.0  # s: longer than a robot with a wrong attitude stays level by chance
MAX_ATTITUDE_LATENCY, LATENCY_DEVIATIONS = 0.02, 3.0  # s, deviations of the estimated latency
ATTITUDE_ERROR_TIME = 2.0  # s over which the errors of an attitude are correlated
MAX_TILT_INTERVAL = 0.5  # s between scans from which an attitude's rate is computed
ATTITUDE_FAULTS = ("beyond", "jumped", "stuck", "contradicted", "late_ms")


class Tilt(NamedTuple):
    """Stamp [s] and attitude of a scan, and `dt` [s] since the scan before.

    `rotation` (3, 3) turns base axes level, `rate` (3, 3) [1/s] is its change.
    """

    t: float
    dt: float
    attitude: Attitude
    rotation: Floats
    rate: Floats


class Leveling:
    """Projects end points by the attitude of their scan, and checks the attitudes.

    An attitude is rejected if the tilt is larger than a robot survives, if it jumps, if it stays
    constant while the robot moves, or if it puts end points below the floor. The scan is then taken
    as level. `counts` of scans is empty until a scan has an attitude.
    """

    def __init__(self) -> None:
        self.counts: dict[str, int] = {}
        self._scan: Scan | None = None
        self._tilt: Tilt | None = None
        self._used = False
        self._jumps = np.zeros(2)  # rad, the sum of jumps: 0 again after a single faulty attitude
        self._jump_time = self._rejected_until = -math.inf  # s
        self._constant_since, self._n_constant = math.inf, 0  # s, scans with the same attitude
        # recent end points: on any floor, below a level floor, below any floor
        self._floor_points = self._below_level = self._below_floor = 0.0
        self._has_ramps = False
        self._residual_rate = self._squared_rate = 0.0  # sums for the regression of the latency

    def project(
        self, scan: Scan, speed: Pose2, points: Points, n: int, scratch: Points
    ) -> tuple[int, float, Pose2] | None:
        """Project n end points (4, >= n) of a scan in place, if its attitude is used.

        Returns the number left, the farthest [m] and the mount of the laser, projected too.
        `speed` of the base [m/s, rad/s]; `scratch` like points. A repeated scan counts once.
        """
        is_new, self._scan = scan is not self._scan, scan
        if is_new:
            self._used = self._check(scan, speed)
        if self._tilt is None:
            return None
        tilt, laser, statistics = self._tilt, scan.laser, np.zeros(5)
        floor = floor_of(laser, self._has_ramps)
        arrays = points, n, tilt.rotation, tilt.rate, laser.time_increment, floor
        left, far = level(*arrays, points if self._used else scratch, statistics)
        if is_new:
            self._add_floor(statistics)
        x, y, _ = tilt.rotation @ (laser.mount.x, laser.mount.y, laser.mount_z)
        return (left, far, Pose2(float(x), float(y), laser.mount.theta)) if self._used else None

    def _check(self, scan: Scan, speed: Pose2) -> bool:
        """Whether the scan has an attitude without fault; counts the scan by its fault."""
        if scan.attitude is None:
            self._tilt = None
            return False
        if not self.counts:
            self.counts = {"leveled": 0} | {f"attitude_{name}": 0 for name in ATTITUDE_FAULTS}
        fault = self._fault(scan.t, scan.attitude, speed)
        self.counts[f"attitude_{fault}" if fault else "leveled"] += 1
        return not fault

    def _fault(self, t: float, attitude: Attitude, speed: Pose2) -> str:
        """Name of the attitude's fault, empty if it has none."""
        last, self._tilt = self._tilt, None
        if max(abs(attitude.roll), abs(attitude.pitch)) > MAX_ROBOT_TILT:
            return "beyond"
        self._tilt = self._tilt_after(last, t, attitude)
        if self._is_stuck(last, t, attitude, speed):
            return "stuck"
        if np.abs(self._jumps).max() > MAX_TILT_STEP:
            below = self._share(self._below_level + self._below_floor)
            if t < self._jump_time + ATTITUDE_RECOVERY_TIME or not below < ACCEPTED_BELOW_SHARE:
                return "jumped"
            self._jumps[:] = 0.0
        limit = ACCEPTED_BELOW_SHARE if t < self._rejected_until else REJECTED_BELOW_SHARE
        if self._share(self._below_floor) > limit:
            self._rejected_until = t + ATTITUDE_RECOVERY_TIME
        return "contradicted" if t < self._rejected_until else ""

    def _share(self, n: float) -> float:
        """Share of n end points among the recent ones on the floor; nan if these are too few."""
        return n / self._floor_points if self._floor_points >= MIN_FLOOR_POINTS else math.nan

    def _tilt_after(self, last: Tilt | None, t: float, attitude: Attitude) -> Tilt:
        """Tilt of a scan with its rate since the last one; a jump is added to `_jumps`."""
        rotation, rate, dt = attitude.rotation(), np.zeros((3, 3)), 0.0
        if last is not None:
            dt, step = max(t - last.t, 0.0), np.subtract(attitude, last.attitude)
            if np.abs(step).max() > MAX_TILT_RATE * dt + MAX_TILT_STEP:
                self._jumps += step
                self._jump_time = t
                self._floor_points = self._below_level = self._below_floor = 0.0
            elif 0.0 < dt < MAX_TILT_INTERVAL:
                rate = (rotation - last.rotation) / dt
        return Tilt(t, dt, attitude, rotation, rate)

    def _is_stuck(self, last: Tilt | None, t: float, attitude: Attitude, speed: Pose2) -> bool:
        """Whether the attitude stays bit for bit the same while the robot moves."""
        moves = math.hypot(speed.x, speed.y) > MIN_MOVING_SPEED
        moves |= abs(speed.theta) > MIN_MOVING_SPEED
        if last is None or attitude != last.attitude or not moves:
            self._constant_since, self._n_constant = t, 0
        self._n_constant += 1
        is_long = t - self._constant_since >= STUCK_TIME and self._n_constant > STUCK_SCANS
        return is_long and any(attitude)

    def _add_floor(self, statistics: Floats) -> None:
        """Add a scan's statistics of the floor; estimate the latency of the attitude."""
        on_floor, below_level, below_floor, residual_rate, squared_rate = statistics.tolist()
        total = on_floor + below_level + below_floor
        keep = max(1.0 - total / FLOOR_MEMORY, 0.0)
        self._floor_points = keep * self._floor_points + total
        self._below_level = keep * self._below_level + below_level
        self._below_floor = keep * self._below_floor + below_floor
        self._has_ramps |= self._used and self._share(self._below_level) > MIN_RAMP_SHARE
        if squared_rate > 0.0 and self._tilt is not None:
            seconds = min(self._tilt.dt, MAX_TILT_INTERVAL)
            self._residual_rate -= seconds * residual_rate / on_floor
            self._squared_rate += seconds * squared_rate / on_floor
            latency = self._residual_rate / self._squared_rate
            error = 0.5 * ATTITUDE_ERROR * math.sqrt(ATTITUDE_ERROR_TIME / self._squared_rate)
            is_late = latency > max(MAX_ATTITUDE_LATENCY, LATENCY_DEVIATIONS * error)
            self.counts["attitude_late_ms"] = round(1e3 * latency) if is_late else 0


def floor_of(laser: Laser, has_ramps: bool = False) -> Floor:
    """Floor under a laser, with the tolerances of the end points on it."""
    height = laser.above_floor
    below = math.inf if height is None else height - laser.mount_z
    mount = laser.mount.x, laser.mount.y, laser.mount_z
    rise = RAMP_HEIGHT if has_ramps else FLOOR_CLEARANCE
    return Floor(*mount, below, FLOOR_CLEARANCE, rise, RAMP_HEIGHT, ATTITUDE_ERROR)
