"""Laser, odometry and heading of pushed scans, checked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from slams.types import Laser, Pose2, Scan
from slams.validation import LONGEST_SWEEP, can_be, check_laser


class ScanChecker:
    """Counts changes of the laser (`lasers`) and `bad_odometry`.

    Args:
        mount: the laser in the robot's base frame.
        counts: where it counts.
    """

    def __init__(self, mount: Pose2, counts: dict[str, int]) -> None:
        self._mount, self._counts = mount, counts
        self._laser: Laser | None = None

    def laser_of(self, n_beams: int, geometry: tuple[float, ...]) -> Laser:
        """The laser of a scan; one object as long as the geometry stays.

        Raises:
            ValueError: there is no such laser.
        """
        angle_min, angle_increment, range_min, range_max, between = map(float, geometry)
        between = between if 0.0 < between * n_beams <= LONGEST_SWEEP else 0.0
        fan = Laser(angle_min, angle_increment, n_beams, range_min, range_max, self._mount, between)
        if fan != self._laser:
            check_laser(fan)
            self._counts["lasers"] += 1
            self._laser = fan
        return self._laser

    def pose_of(self, odometry: Sequence[float] | None) -> Pose2 | None:
        """Odometry as a pose; None where a number is not finite.

        Raises:
            ValueError: it is not x, y, theta.
        """
        if odometry is None:
            return None
        if len(odometry) != 3:
            raise ValueError(f"odometry: got {len(odometry)} numbers, expected x, y, theta")
        pose = Pose2(*map(float, odometry))
        if all(map(math.isfinite, pose)):
            return pose
        self._counts["bad_odometry"] += 1
        return None

    def checked(self, scan: Scan) -> Scan:
        """The scan without odometry or heading that no robot can have."""
        if scan.odometry is not None and not can_be(*scan.odometry):
            self._counts["bad_odometry"] += 1
            scan = replace(scan, odometry=None)
        return replace(scan, yaw=None) if scan.yaw is not None and not can_be(scan.yaw) else scan
