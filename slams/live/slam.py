"""LiveSlam: scans pushed one by one as a robot delivers them, for a node of your own.

A log is complete and in order; a robot's scans come late, twice, with other beam counts, with and
without odometry. What is not fit for the algorithm is held back here and counted.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from slams.heading import Heading
from slams.live.drawing import Drawer
from slams.live.estimate import LOST, Confidence, Estimate, covariance, quality
from slams.plausible import LONGEST_SWEEP, can_be, check_laser, check_stamps, expect
from slams.registry import find
from slams.ros.stamps import seconds
from slams.scanlog import ScanLog, single
from slams.types import IDENTITY, Laser, OccupancyGrid, Pose2, Scan, Slam

LATE_IN_A_ROW = 10  # after so many scans from the past the clock was set back


class LiveSlam:
    """One algorithm fed scan by scan.

    The kernels are compiled in the constructor (seconds the first time, then kept on disk), so no
    push waits for them. All methods may be called from several threads; they take turns. While a
    map is drawn, a push waits at most for a copy of what it is drawn from.

    Args:
        algorithm: as on the command line: "hector", "tsd@original", "module:Class".
        mount: the laser in the robot's base frame.
        sensor: preset for a laser, as `--sensor`.
        warm_up: False leaves the compilation to the first scans.
        changes: single parameters.

    Raises:
        LookupError: unknown algorithm, sensor or parameter.
        ValueError: a parameter out of its bounds.
    """

    def __init__(
        self,
        algorithm: str = "hector",
        *,
        mount: Pose2 = IDENTITY,
        sensor: str | None = None,
        warm_up: bool = True,
        **changes: Any,
    ) -> None:
        self._entry = find(algorithm)
        params = self._entry.params()
        if sensor is not None:
            params = params.for_sensor(sensor)
        self.params = params.replace(**changes)
        self._mount = mount
        self._lock = threading.RLock()
        if warm_up:
            self._warm_up()
        self.reset()

    def reset(self) -> None:
        """Forget map and pose; the next scan's pose is the origin of a new map."""
        with self._lock:
            self._slam: Slam = self._entry.cls(self.params)
            self._confidence = Confidence()
            self._drawer = Drawer()
            self._yaw = Heading()
            self._laser: Laser | None = None
            self._last: Estimate | None = None
            self._fitted_at = -math.inf
            self._late = 0
            names = ("scans", "late", "repeated", "lasers", "bad_odometry", "clock_set_back")
            self._counts = dict.fromkeys(names, 0)

    def push(
        self,
        stamp: float,
        ranges: ArrayLike,
        angle_min: float,
        angle_increment: float,
        range_min: float,
        range_max: float,
        *,
        time_increment: float = 0.0,
        odometry: Sequence[float] | None = None,
        yaw_rate: float | None = None,
    ) -> Estimate:
        """Take one scan, with the fields of a sensor_msgs/LaserScan.

        Args:
            stamp: time of the first beam [s].
            ranges: (n,) [m]; inf, nan and values outside of the limits as in REP 117.
            angle_min: direction of the first beam [rad].
            angle_increment: from beam to beam [rad], negative for a laser that turns clockwise.
            range_min: nearest valid range [m].
            range_max: farthest valid range [m].
            time_increment: from beam to beam [s]; less than 0 or not finite counts as 0.
            odometry: x, y [m], theta [rad] of the base in the odom frame at the stamp.
            yaw_rate: of the gyro at the stamp [rad/s]; or push it more often by `push_yaw_rate`.

        Raises:
            ValueError: the fields are not those of a scan.
        """
        values = single(ranges)
        if values.ndim != 1 or not len(values):
            raise ValueError(f"ranges: got shape {values.shape}, expected (n,) with n >= 1")
        geometry = (angle_min, angle_increment, range_min, range_max, time_increment)
        check_stamps("stamp", np.array([float(stamp)]))
        with self._lock:
            laser = self._laser_of(len(values), geometry)
            one = ScanLog(np.array([float(stamp)]), values[None], laser)
            if yaw_rate is not None:
                self._yaw.push(float(stamp), yaw_rate)
            yaw = self._yaw.at(float(stamp))
            return self.push_scan(
                Scan(float(stamp), one.ranges[0], laser, self._pose_of(odometry), yaw)
            )

    def push_message(
        self,
        message: Any,
        *,
        odometry: Sequence[float] | None = None,
        yaw_rate: float | None = None,
    ) -> Estimate:
        """Take one sensor_msgs/LaserScan of ROS 1 or ROS 2, or anything with its fields."""
        return self.push(
            seconds(message.header.stamp),
            message.ranges,
            message.angle_min,
            message.angle_increment,
            message.range_min,
            message.range_max,
            time_increment=message.time_increment,
            odometry=odometry,
            yaw_rate=yaw_rate,
        )

    def push_scan(self, scan: Scan) -> Estimate:
        """Take one `Scan`, its ranges cleaned as a `ScanLog` does it.

        Raises:
            ValueError: stamp, ranges or laser are not those of a scan.
        """
        check_stamps("stamp", np.array([scan.t]))
        check_laser(scan.laser)
        shape, expected = np.shape(scan.ranges), (scan.laser.n_beams,)
        expect(shape == expected, "ranges", f"shape {shape}", f"{expected}")
        with self._lock:
            scan = self._believed(scan)
            if self._last is not None and not self._is_next(scan.t, self._last):
                return self._last
            self._late = 0
            self._counts["scans"] += 1
            pose = self._slam.update(scan)
            self._last = self._estimate(scan, pose)
            return self._last

    def push_yaw_rate(self, stamp: float, rate: float) -> None:
        """Take one reading of the gyro [rad/s], as often as it comes."""
        with self._lock:
            self._yaw.push(stamp, rate)

    @property
    def held(self) -> float:
        """For how long [s] the last map kept pushes waiting."""
        return self._drawer.held

    @property
    def last(self) -> Estimate | None:
        """The estimate of the last push; None before the first."""
        with self._lock:
            return self._last

    def map(self) -> OccupancyGrid:
        """The map as it stands now; drawn when asked for, and pushes wait as little as can be."""
        return self._drawer.draw(self._slam, self._lock)

    def report(self) -> dict[str, Any]:
        """Counts: scans used, late, repeated, changes of the laser; then the algorithm's own."""
        with self._lock:
            return self._counts | {"algorithm": self._slam.report()}

    def _is_next(self, t: float, last: Estimate) -> bool:
        """Whether a stamp is later than the last; if not for long, the clock was set back."""
        if t > last.t:
            return True
        self._counts["repeated" if t == last.t else "late"] += 1
        self._late += t < last.t
        if self._late > LATE_IN_A_ROW:
            self._counts["clock_set_back"] += 1
            self._fitted_at = t
            return True
        self._last = replace(last, used=False)
        return False

    def _estimate(self, scan: Scan, pose: Pose2) -> Estimate:
        state = self._confidence.state(self._slam)
        lost = state == LOST
        if not lost or math.isinf(self._fitted_at):
            self._fitted_at = scan.t
        return Estimate(
            t=scan.t,
            pose=pose,
            map_to_odom=None if scan.odometry is None else pose @ scan.odometry.inverse(),
            covariance=covariance(self._slam),
            quality=quality(self._slam),
            used=True,
            lost=lost,
            seconds_lost=scan.t - self._fitted_at,
            state=state,
        )

    def _laser_of(self, n_beams: int, geometry: tuple[float, ...]) -> Laser:
        """The laser; one object as long as the geometry stays."""
        angle_min, angle_increment, range_min, range_max, between = map(float, geometry)
        between = between if 0.0 < between * n_beams <= LONGEST_SWEEP else 0.0
        fan = Laser(angle_min, angle_increment, n_beams, range_min, range_max, self._mount, between)
        if fan != self._laser:
            check_laser(fan)
            self._counts["lasers"] += 1
            self._laser = fan
        return self._laser

    def _pose_of(self, odometry: Sequence[float] | None) -> Pose2 | None:
        if odometry is None:
            return None
        if len(odometry) != 3:
            raise ValueError(f"odometry: got {len(odometry)} numbers, expected x, y, theta")
        pose = Pose2(*map(float, odometry))
        if all(map(math.isfinite, pose)):
            return pose
        self._counts["bad_odometry"] += 1  # a scan keeps no numbers that are none
        return None

    def _believed(self, scan: Scan) -> Scan:
        """The scan without odometry or heading that cannot be."""
        odometry, yaw = scan.odometry, scan.yaw
        if odometry is not None and not can_be(*odometry):
            self._counts["bad_odometry"] += 1
            odometry = None
        if yaw is not None and not can_be(yaw):
            yaw = None
        same = odometry is scan.odometry and yaw is scan.yaw
        return scan if same else replace(scan, odometry=odometry, yaw=yaw)

    def _warm_up(self) -> None:
        """Let throw-away instances see a room: at rest, on the move, as a sweep, and lost."""
        from slams.room import drive, laser, scan_at

        for increment, measured in ((0.0, True), (5e-4, False)):
            lidar = replace(laser(n_beams=91), time_increment=increment)
            log = drive(n=8, rate=5.0, lidar=lidar, odometry=measured, gyro=measured)
            slam = self._entry.cls(self.params)
            for scan in (*log, scan_at((2.0, 1.5, 2.0), lidar, t=2.0)):
                slam.update(scan)
            slam.map()
