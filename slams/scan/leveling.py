"""Leveling: end points of a tilted laser in the plane, and what is wrong with an attitude."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.scan.scan_kernels import Points
from slams.scan.tilt_kernels import BELOW, DEEP, HITS, LATE, SWUNG, Floor, level
from slams.types import Attitude, Floats, Laser, Pose2, Scan

ATTITUDE_ERROR = math.radians(0.6)  # rad: two deviations of a good attitude reference
CLEARANCE = 0.05  # m above the floor: bumps, and the width of a beam
UNEVEN = 0.2  # m that ramps rise and fall by, from the floor under the robot
RAMPS = 0.1  # share of the ends at the floor that are deeper than a level one: there are ramps
MAX_TILT = math.radians(50.0)  # rad: a robot that tilts more has fallen, or its IMU hangs overhead
MAX_TILT_RATE = 1.0  # rad/s: of a robot that tips over a step
MAX_STEP = math.radians(3.0)  # rad beside that, from scan to scan: noise and latency
STUCK_AFTER, STUCK_SCANS = 0.5, 4  # s and scans: a moving robot shakes
MOVING = 0.05  # m/s or rad/s: the least speed of a robot that moves
FLOOR_MEMORY, FLOOR_ENOUGH = 400.0, 50.0  # ends at the floor: kept in mind; that show anything
WRONG, RIGHT = 0.4, 0.1  # shares of these below the floor: of one that is late a third at most
RECOVERY = 10.0  # s: a wrong attitude is right whenever the robot is level; that lasts less
MAX_LATENCY, DEVIATIONS = 0.02, 3.0  # s; deviations of the estimate: an attitude is called late
ERRORS_LAST = 2.0  # s over which the errors of an attitude are one and the same
MAX_INTERVAL = 0.5  # s between scans: over more an attitude has no rate
COUNTS = ("beyond", "jumped", "stuck", "contradicted", "late_ms")


class Tilt(NamedTuple):
    """Stamp and attitude of a scan; rotation (3, 3) from base to level axes, its rate [1/s].

    `dt` [s] since the scan before.
    """

    t: float
    dt: float
    attitude: Attitude
    rotation: Floats
    rate: Floats


class Leveling:
    """Projects end points by the attitudes of their scans, and checks these.

    Not used is an attitude beyond what a robot survives, one that has jumped, that stays the same
    while the robot moves, or that puts ends of beams below the floor: then a scan is taken as it
    was scanned. `counts` of scans; empty while none had an attitude.
    """

    def __init__(self) -> None:
        self.counts: dict[str, int] = {}
        self._scan: Scan | None = None
        self._tilt: Tilt | None = None
        self._used = False
        self._jumps = np.zeros(2)  # rad: sum of jumps; one that is taken back was a single fault
        self._jumped_at = self._doubted_until = -math.inf  # s
        self._same_since, self._same = math.inf, 0  # s, scans: of this very attitude
        self._ends = self._deep = self._below = 0.0  # lately at the floor; deeper; too deep
        self._has_ramps = False
        self._late, self._swung = 0.0, 0.0  # sums for the regression of the latency

    def project(
        self, scan: Scan, speed: Pose2, points: Points, n: int, room: Points
    ) -> tuple[int, float, Pose2] | None:
        """Project n end points (3, >= n) of a scan in place, if its attitude is used.

        Returns how many are left, the farthest [m] and the laser's mount as seen from above.
        `speed` of the base [m/s, rad/s]; `room` is like points. A scan taken again counts once.
        """
        again, self._scan = scan is self._scan, scan
        if not again:
            self._used = self._check(scan, speed)
        if self._tilt is None:
            return None
        tilt, laser, found = self._tilt, scan.laser, np.zeros(5)
        floor = floor_of(laser, self._has_ramps)
        arrays = points, n, tilt.rotation, tilt.rate, laser.time_increment, floor
        left, far = level(*arrays, points if self._used else room, found)
        if not again:
            self._learn(found)
        x, y, _ = tilt.rotation @ (laser.mount.x, laser.mount.y, laser.mount_z)
        return (left, far, Pose2(float(x), float(y), laser.mount.theta)) if self._used else None

    def _check(self, scan: Scan, speed: Pose2) -> bool:
        """Count the scan by the fault of its attitude; whether it has none."""
        if scan.attitude is None:
            self._tilt = None
            return False
        if not self.counts:
            self.counts = {"leveled": 0} | {f"attitude_{name}": 0 for name in COUNTS}
        fault = self._fault(scan.t, scan.attitude, speed)
        self.counts[f"attitude_{fault}" if fault else "leveled"] += 1
        return not fault

    def _fault(self, t: float, attitude: Attitude, speed: Pose2) -> str:
        last, self._tilt = self._tilt, None
        if max(abs(attitude.roll), abs(attitude.pitch)) > MAX_TILT:
            return "beyond"
        self._tilt = self._followed(last, t, attitude)
        if self._is_stuck(last, t, attitude, speed):
            return "stuck"
        if np.abs(self._jumps).max() > MAX_STEP:
            deeper = self._share(self._deep + self._below)
            if t < self._jumped_at + RECOVERY or not deeper < RIGHT:
                return "jumped"
            self._jumps[:] = 0.0
        if self._share(self._below) > (RIGHT if t < self._doubted_until else WRONG):
            self._doubted_until = t + RECOVERY
        return "contradicted" if t < self._doubted_until else ""

    def _share(self, ends: float) -> float:
        """Of the ends lately at the floor; nan where these are too few to show anything."""
        return ends / self._ends if self._ends >= FLOOR_ENOUGH else math.nan

    def _followed(self, last: Tilt | None, t: float, attitude: Attitude) -> Tilt:
        """The tilt with its rate; notes a jump."""
        rotation, rate, dt = attitude.rotation(), np.zeros((3, 3)), 0.0
        if last is not None:
            dt, step = max(t - last.t, 0.0), np.subtract(attitude, last.attitude)
            if np.abs(step).max() > MAX_TILT_RATE * dt + MAX_STEP:
                self._jumps += step
                self._jumped_at = t
                self._ends = self._deep = self._below = 0.0
            elif 0.0 < dt < MAX_INTERVAL:
                rate = (rotation - last.rotation) / dt
        return Tilt(t, dt, attitude, rotation, rate)

    def _is_stuck(self, last: Tilt | None, t: float, attitude: Attitude, speed: Pose2) -> bool:
        """Whether a robot moves, and its attitude has not changed in the last bit for a while."""
        moves = math.hypot(speed.x, speed.y) > MOVING or abs(speed.theta) > MOVING
        if last is None or attitude != last.attitude or not moves:
            self._same_since, self._same = t, 0
        self._same += 1
        return t - self._same_since >= STUCK_AFTER and self._same > STUCK_SCANS and any(attitude)

    def _learn(self, found: Floats) -> None:
        """Take in what the scan shows of the floor."""
        ends = float(found[HITS] + found[DEEP] + found[BELOW])
        keep = max(1.0 - ends / FLOOR_MEMORY, 0.0)
        self._ends = keep * self._ends + ends
        self._deep = keep * self._deep + float(found[DEEP])
        self._below = keep * self._below + float(found[BELOW])
        self._has_ramps |= self._used and self._share(self._deep) > RAMPS
        if found[SWUNG] > 0.0 and self._tilt is not None:
            seconds = min(self._tilt.dt, MAX_INTERVAL)
            self._late -= seconds * float(found[LATE] / found[HITS])
            self._swung += seconds * float(found[SWUNG] / found[HITS])
            late = self._late / self._swung
            error = 0.5 * ATTITUDE_ERROR * math.sqrt(ERRORS_LAST / self._swung)
            is_late = late > max(MAX_LATENCY, DEVIATIONS * error)
            self.counts["attitude_late_ms"] = round(1e3 * late) if is_late else 0


def floor_of(laser: Laser, has_ramps: bool = False) -> Floor:
    """Where the floor lies under a laser, and how much an end point near it may be off."""
    height = laser.above_floor
    below = math.inf if height is None else height - laser.mount_z
    mount = laser.mount.x, laser.mount.y, laser.mount_z
    rise = UNEVEN if has_ramps else CLEARANCE
    return Floor(*mount, below, CLEARANCE, rise, UNEVEN, ATTITUDE_ERROR)
