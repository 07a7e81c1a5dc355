"""What is believed of a scan: its laser, its odometry and its heading."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from slams.types import Laser, Pose2, Scan
from slams.validation import LONGEST_SWEEP, can_be, check_laser


class Intake:
    """Makes scans of what a robot tells; counts in `lasers` and `bad_odometry` what was odd.

    Args:
        mount: the laser in the robot's base frame.
        counts: where it counts.
    """

    def __init__(self, mount: Pose2, counts: dict[str, int]) -> None:
        self._mount, self._counts = mount, counts
        self._laser: Laser | None = None

    def laser_of(self, n_beams: int, geometry: tuple[float, ...]) -> Laser:
        """The laser; one object as long as the geometry stays.

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
        """The base by the wheels; None where they tell no numbers.

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
        self._counts["bad_odometry"] += 1  # a scan keeps no numbers that are none
        return None

    def believed(self, scan: Scan) -> Scan:
        """The scan without odometry or heading that cannot be."""
        odometry, yaw = scan.odometry, scan.yaw
        if odometry is not None and not can_be(*odometry):
            self._counts["bad_odometry"] += 1
            odometry = None
        if yaw is not None and not can_be(yaw):
            yaw = None
        same = odometry is scan.odometry and yaw is scan.yaw
        return scan if same else replace(scan, odometry=odometry, yaw=yaw)
