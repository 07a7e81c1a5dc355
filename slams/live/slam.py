"""LiveSlam: scans pushed one by one as a robot delivers them, for a node of your own.

A log is complete and in order; a robot's scans come late, twice, with other beam counts, with and
without odometry. Scans that an algorithm cannot take are left out here and counted.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from slams.laser_table import rep117
from slams.live.estimate import LATE_IN_A_ROW, LOST, MATCHED, STATES, Estimate
from slams.live.given_map import Seeker
from slams.live.warm_up import warm_up as warm_up_kernels
from slams.registry import find
from slams.ros.messages import READ, SCAN, seconds
from slams.state.store import check_target, resume, save_after
from slams.types import (
    IDENTITY,
    Attitude,
    Corrected,
    Floats,
    OccupancyGrid,
    Pose2,
    Scan,
    Slam,
)
from slams.validation import MAX_SWEEP_TIME, check_laser, check_stamps, expect, is_plausible

MAX_RESUME_GAP = 60.0  # [s] after a state's last scan in which wheels are taken to have counted on
COUNTS = ("scans", "late", "repeated", "clock_set_back")


class LiveSlam:
    """One algorithm fed scan by scan.

    The kernels are compiled in the constructor (seconds the first time, then kept on disk), so no
    push waits for them. All methods may be called from several threads; they take turns.

    Args:
        algorithm: as on the command line: "hector", "tsd@original", "module:Class".
        mount: of the laser of messages in the robot's base frame; a `Scan` has its own.
        sensor: preset for a laser, as `--sensor`.
        warm_up: False leaves the compilation to the first scans.
        state: a file of `save` to go on from, with its own parameters.
        map: a map that stays as it is, to localize in: a saved state, a yaml of map_server, or an
            `OccupancyGrid`. Poses are in its frame; while the place is sought, estimates are not
            `found`.
        map_start: about where in it the first scan is, x, y [m], theta [rad]; None seeks it.
        changes: single parameters.

    `given` is the map that stays, if there is one. `notes` are sentences for the user about it, and
    where in it the robot was found. `last` is the estimate of the last push, None before the first.

    Raises:
        LookupError: unknown algorithm, sensor or parameter.
        OSError: a file cannot be opened.
        TypeError: the algorithm cannot localize.
        ValueError: a parameter out of its bounds, or a file that is no such thing.
    """

    def __init__(
        self,
        algorithm: str = "hector",
        *,
        mount: Pose2 = IDENTITY,
        sensor: str | None = None,
        warm_up: bool = True,
        state: str | Path | None = None,
        map: str | Path | OccupancyGrid | None = None,  # noqa: A002  # as users call it
        map_start: Sequence[float] | None = None,
        **changes: Any,
    ) -> None:
        entry = find(algorithm)
        params = entry.params()
        if sensor is not None:
            params = params.for_sensor(sensor)
        self.params = params.replace(**changes)
        self._mount = mount
        self._lock = threading.RLock()
        if map is not None and state is not None:
            raise ValueError("map: stays as it is; got a state to go on from, too")
        self.notes: list[str] = []
        if map is None and map_start is not None:
            raise ValueError("map_start: got a place without a map; expected map, too")
        seeker = None if map is None else Seeker(entry, self.params, map, map_start, self.notes)
        self.given = None if seeker is None else seeker.map()
        saved = None if state is None else resume(state, entry, self.params)
        self._saved_at = None if saved is None else saved.beside.get("t")
        self.params = getattr(saved and saved.slam, "params", self.params)
        if warm_up:
            warm_up_kernels(entry.cls, self.params)
        self._slam: Slam = seeker or (saved.slam if saved else entry.cls(self.params))
        self.last: Estimate | None = None
        self._scan: Scan | None = None
        self._matched_at, self._late = -math.inf, 0
        self._counts = dict.fromkeys(COUNTS, 0)

    def push_message(
        self,
        message: Any,
        *,
        odometry: Sequence[float] | None = None,
        yaw: float | None = None,
        attitude: Sequence[float] | None = None,
    ) -> Estimate:
        """Take one sensor_msgs/LaserScan of ROS 1 or ROS 2, or anything with its fields.

        Args:
            message: its stamp, or a number [s], is of the first beam; `ranges` (n,) [m] are as in
                REP 117; a `time_increment` less than 0 or not finite counts as 0.
            odometry: x, y [m], theta [rad] of the base in the odom frame at the stamp.
            yaw: heading by the gyro at the stamp [rad], counted from anywhere: its rates summed up.
            attitude: roll and pitch [rad] of the base at the stamp.

        Raises:
            ValueError: the fields are not those of a scan.
        """
        if odometry is not None:
            expect(len(odometry) == 3, "odometry", f"{len(odometry)} numbers", "x, y, theta")
        _, (ranges, geometry) = READ[SCAN](message)
        lasts = geometry.time_increment * geometry.n_beams
        between = geometry.time_increment if 0.0 < lasts <= MAX_SWEEP_TIME else 0.0
        laser = replace(geometry, mount=self._mount, time_increment=between)
        scan = Scan(
            seconds(message.header.stamp),
            ranges,
            laser,
            None if odometry is None else Pose2(*map(float, odometry)),
            None if yaw is None else float(yaw),
            None if attitude is None else Attitude(*map(float, attitude)),
        )
        return self.push_scan(scan)

    def push_scan(self, scan: Scan) -> Estimate:
        """Take one `Scan`; its ranges are cleaned as those of a log.

        Raises:
            ValueError: stamp, ranges or laser are not those of a scan.
        """
        check_stamps("stamp", np.array([scan.t]))
        shape, n = np.shape(scan.ranges), scan.laser.n_beams
        expect(shape == (n,) and n > 0, "ranges", f"shape {shape}", f"({n or 'n'},)")
        check_laser(scan.laser)
        scan = replace(scan, ranges=rep117(scan.ranges, scan.laser))
        with self._lock:
            scan = self._checked(scan)
            again = self._again(scan.t)
            if again is not None:
                return again
            self._counts["scans"] += 1
            self._scan = scan
            pose = self._slam.update(scan)
            if isinstance(self._slam, Seeker):
                self._slam = self._slam.localizer or self._slam
            self.last = self._estimate(scan, pose)
            return self.last

    def map(self) -> OccupancyGrid:
        """The map as it stands now, drawn when asked for.

        Pushes wait meanwhile, or only for a copy where the algorithm has a method `snapshot`, which
        returns a function that draws the map as it stood while updates go on.
        """
        with self._lock:
            drawn = getattr(self._slam, "snapshot", self._slam.map)()
        return drawn if isinstance(drawn, OccupancyGrid) else drawn()

    def corrected(self) -> Floats | None:
        """Poses (n, 3) of all pushes that were used, as closed loops have corrected them by now.

        None where the algorithm closes no loops.
        """
        with self._lock:
            if not isinstance(self._slam, Corrected):
                return None
            poses = self._slam.corrected()
            return poses[len(poses) - self._counts["scans"] :]

    def save(self, path: str | Path, **beside: Any) -> None:
        """Keep all that is known in one file, whole or not at all, to go on from by `state=`.

        Pushes wait meanwhile. `beside` are numbers and lists of yours that are kept with it.

        Raises:
            OSError: the file cannot be written.
            TypeError: the algorithm keeps something that no state can hold.
            ValueError: there was no scan yet, or the map is one that stays.
        """
        with self._lock:
            if self.given is not None or self._scan is None:
                why = "no scan came yet" if self.given is None else "the map stays as it was given"
                raise ValueError(f"{path}: nothing to save: {why}")
            save_after(self._slam, path, self._scan.t, self._scan.ranges, **beside)

    def check_saving(self, path: str | Path) -> None:
        """Refuse, before any work is done, what `save` could not do; it raises the same."""
        check_target(path, self._slam)

    @property
    def candidates(self) -> str:
        """The likely places while the place in a given map is sought, in words; else nothing."""
        return self._slam.candidates if isinstance(self._slam, Seeker) else ""

    def report(self) -> dict[str, Any]:
        """Counts: scans used, late, repeated, clocks set back; then the algorithm's own."""
        with self._lock:
            return self._counts | {"algorithm": self._slam.report()}

    def _checked(self, scan: Scan) -> Scan:
        """The scan without odometry or heading that no robot can have, or that began anew.

        A laser that is equal to that of the last scan is the same object.
        The first scan after a state has no heading, and odometry only if it comes soon: a robot
        that was switched off has begun to count anew.
        """
        last, odometry, yaw = self._scan, scan.odometry, scan.yaw
        if last is None and self._saved_at is not None:
            goes_on = 0.0 < scan.t - self._saved_at <= MAX_RESUME_GAP
            odometry, yaw = odometry if goes_on else None, None
        return replace(
            scan,
            laser=last.laser if last is not None and last.laser == scan.laser else scan.laser,
            odometry=None if odometry is None or not is_plausible(*odometry) else odometry,
            yaw=None if yaw is None or not is_plausible(yaw) else yaw,
        )

    def _again(self, t: float) -> Estimate | None:
        """The last one for a stamp that is not later; after many of them the clock was set back."""
        if self.last is not None and t <= self.last.t:
            self._counts["repeated" if t == self.last.t else "late"] += 1
            self._late += t < self.last.t
            if self._late <= LATE_IN_A_ROW:
                self.last = replace(self.last, used=False)
                return self.last
            self._counts["clock_set_back"] += 1
            self._matched_at = t
        self._late = 0
        return None

    def _estimate(self, scan: Scan, pose: Pose2) -> Estimate:
        """The estimate after a scan; what the algorithm has no attribute for gets a default."""
        said = str(getattr(self._slam, "state", None))
        state = said if said in STATES else MATCHED
        if state != LOST or math.isinf(self._matched_at):
            self._matched_at = scan.t
        covariance = getattr(self._slam, "covariance", None)
        return Estimate(
            t=scan.t,
            pose=pose,
            map_to_odom=None if scan.odometry is None else pose @ scan.odometry.inverse(),
            covariance=np.diag([math.inf] * 3) if covariance is None else np.array(covariance),
            quality=float(getattr(self._slam, "quality", math.nan)),
            used=True,
            seconds_lost=scan.t - self._matched_at,
            state=state,
            found=not isinstance(self._slam, Seeker),
            explained=float(getattr(self._slam, "explained", math.nan)),
        )
