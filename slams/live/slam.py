"""LiveSlam: an algorithm fed scan by scan as a robot delivers them, for a node of your own.

A log is complete and in order. A robot's scans arrive late, twice, with changing beam counts, with
and without odometry. Scans that an algorithm cannot process are left out here and counted.
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
from slams.live.estimate import LOST, MATCHED, MAX_CONSECUTIVE_LATE, STATES, Estimate
from slams.live.given_map import GivenMapSlam
from slams.live.warm_up import warm_up as warm_up_kernels
from slams.registry import find
from slams.ros.messages import READERS, SCAN_TYPE, seconds
from slams.state.store import check_params, check_target, read_state, save_after
from slams.types import IDENTITY, Attitude, Corrected, Floats, OccupancyGrid, Pose2, Scan, Slam
from slams.validation import MAX_SWEEP_TIME, check_laser, check_stamps, expect, is_plausible

MAX_RESUME_GAP = 60.0  # s after a state's last scan; after more the odometry may have been reset
PUSH_COUNTERS = ("scans", "late", "repeated", "clock_set_back")


class LiveSlam:
    """One algorithm fed scan by scan.

    The constructor compiles the kernels (seconds the first time, then cached on disk), so no push
    waits for them. All methods may be called from several threads; a lock serializes them.

    Args:
        algorithm: as on the command line: "hector", "tsd@original", "module:Class".
        mount: the laser in the robot's base frame, for messages; a `Scan` has its own mount.
        sensor: preset for a laser, as `--sensor`.
        warm_up: False compiles during the first scans instead.
        state: a file of `save` to resume from, with its own parameters.
        map: a fixed map to localize in: a saved state, a yaml of map_server, or an
            `OccupancyGrid`. Poses are in its frame; until the robot is localized, estimates are not
            `found`.
        map_start: approximate pose of the first scan in the map, x, y [m], theta [rad]; None:
            global localization.
        changes: single parameters.

    `given` is the fixed map or None. `notes` are sentences for the user about it, with the pose at
    which the robot was localized. `last` is the estimate of the last push, None before the first.

    Raises:
        LookupError: unknown algorithm, sensor or parameter.
        OSError: a file cannot be opened.
        TypeError: the algorithm cannot localize.
        ValueError: a parameter is out of its bounds, or a file has another content.
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
        params = params.replace(**changes)
        self._mount = mount
        self._lock = threading.RLock()
        if map is not None and state is not None:
            raise ValueError("map: got a state to resume from, too; a given map does not change")
        self.notes: list[str] = []
        if map is None and map_start is not None:
            raise ValueError("map_start: got a pose without a map; expected map, too")
        checked = params, sensor is not None or bool(changes)
        given = None if map is None else GivenMapSlam(entry, *checked, map, map_start, self.notes)
        saved = None if state is None else read_state(state, entry.label)
        if state is not None and saved is not None:
            check_params(state, saved.slam, *checked)
        self.given = None if given is None else given.map()
        self._saved_at = None if saved is None else saved.beside.get("t")
        self.params = getattr(given or (saved and saved.slam), "params", params)
        if warm_up:
            warm_up_kernels(entry.cls, self.params)
        self._slam: Slam = given or (saved.slam if saved else entry.cls(self.params))
        self.last: Estimate | None = None
        self._scan: Scan | None = None
        self._mounts: list[tuple[Pose2, float]] = []  # of the lasers that scanned at its stamp
        self._matched_at, self._n_late = -math.inf, 0
        self._counts = dict.fromkeys(PUSH_COUNTERS, 0)

    def push_message(
        self,
        message: Any,
        *,
        odometry: Sequence[float] | None = None,
        yaw: float | None = None,
        attitude: Sequence[float] | None = None,
        mid_odometry: Sequence[float] | None = None,
        mid_yaw: float | None = None,
    ) -> Estimate:
        """Process one sensor_msgs/LaserScan of ROS 1 or ROS 2, or any object with its fields.

        Args:
            message: its stamp, a ROS stamp or a number [s], is of the first beam; `ranges` (n,) [m]
                as in REP 117; a `time_increment` less than 0 or not finite counts as 0.
            odometry: x, y [m], theta [rad] of the base in the odom frame at the stamp.
            yaw: integrated rates of the gyro at the stamp [rad], with any origin.
            attitude: roll and pitch [rad] of the base at the stamp.
            mid_odometry: the same as odometry, half a sweep later; for a rotating laser.
            mid_yaw: the same as yaw, half a sweep later.

        Raises:
            ValueError: the fields are not those of a scan.
        """
        for pose in (odometry, mid_odometry):
            if pose is not None:
                expect(len(pose) == 3, "odometry", f"{len(pose)} numbers", "x, y, theta")
        _, (ranges, geometry) = READERS[SCAN_TYPE](message)
        duration = geometry.time_increment * geometry.n_beams
        increment = geometry.time_increment if 0.0 < duration <= MAX_SWEEP_TIME else 0.0
        laser = replace(geometry, mount=self._mount, time_increment=increment)
        scan = Scan(
            seconds(message.header.stamp),
            ranges,
            laser,
            None if odometry is None else Pose2(*map(float, odometry)),
            None if yaw is None else float(yaw),
            None if attitude is None else Attitude(*map(float, attitude)),
            None if mid_odometry is None else Pose2(*map(float, mid_odometry)),
            None if mid_yaw is None else float(mid_yaw),
        )
        return self.push_scan(scan)

    def push_scan(self, scan: Scan) -> Estimate:
        """Process one `Scan`; its ranges are cleaned like those of a log.

        Raises:
            ValueError: stamp, ranges or laser are not those of a scan.
        """
        check_stamps("stamp", np.array([scan.t]))
        shape, n = np.shape(scan.ranges), scan.laser.n_beams
        expect(shape == (n,) and n > 0, "ranges", f"shape {shape}", f"({n or 'n'},)")
        check_laser(scan.laser)
        scan = replace(scan, ranges=rep117(scan.ranges, scan.laser))
        with self._lock:
            scan = self._validated(scan)
            previous = self._previous_if_not_newer(scan)
            if previous is not None:
                return previous
            self._counts["scans"] += 1
            self._scan = scan
            pose = self._slam.update(scan)
            if isinstance(self._slam, GivenMapSlam):
                self._slam = self._slam.localizer or self._slam
            self.last = self._estimate(scan, pose)
            return self.last

    def map(self) -> OccupancyGrid:
        """The current map, drawn on request.

        Pushes wait while it is drawn. If the algorithm has a method `snapshot` they wait only for a
        copy: `snapshot` returns a function that draws the copied map while updates continue.
        """
        with self._lock:
            snapshot = getattr(self._slam, "snapshot", self._slam.map)()
        return snapshot if isinstance(snapshot, OccupancyGrid) else snapshot()

    def corrected(self) -> Floats | None:
        """Poses (n, 3) of all used pushes, corrected by the loops closed so far.

        None if the algorithm closes no loops.
        """
        with self._lock:
            if not isinstance(self._slam, Corrected):
                return None
            poses = self._slam.corrected()
            return poses[len(poses) - self._counts["scans"] :]

    def save(self, path: str | Path, **beside: Any) -> None:
        """Save the complete state in one file, to resume from by `state=`.

        Pushes wait meanwhile. `beside` are your own numbers and lists, saved with the state.

        Raises:
            OSError: the file cannot be written; then there is none.
            TypeError: the algorithm has a value that cannot be saved.
            ValueError: there was no scan yet, or the map is a given one.
        """
        with self._lock:
            if self.given is not None or self._scan is None:
                why = "no scan yet" if self.given is None else "a given map does not change"
                raise ValueError(f"{path}: nothing to save: {why}")
            save_after(self._slam, path, self._scan.t, self._scan.ranges, **beside)

    def check_saving(self, path: str | Path) -> None:
        """Check in advance that `save` can work; raises the same errors."""
        check_target(path, self._slam)

    @property
    def candidates(self) -> str:
        """During global localization in a given map the likeliest candidates as text, else ""."""
        return self._slam.candidates if isinstance(self._slam, GivenMapSlam) else ""

    def report(self) -> dict[str, Any]:
        """Counts of scans used, late, repeated and of clock resets, and the algorithm's report."""
        with self._lock:
            return self._counts | {"algorithm": self._slam.report()}

    def _validated(self, scan: Scan) -> Scan:
        """The scan without impossible odometry or heading; an unchanged laser is the same object.

        The first scan after a resumed state loses its heading, and its odometry after more than
        `MAX_RESUME_GAP`: both restart at 0 when a robot is switched off.
        """
        last, poses, yaws = self._scan, [scan.odometry, scan.mid_odometry], [scan.yaw, scan.mid_yaw]
        if last is None and self._saved_at is not None:
            is_continued = 0.0 < scan.t - self._saved_at <= MAX_RESUME_GAP
            poses, yaws = poses if is_continued else [None, None], [None, None]
        odometry, mid_odometry = (one if one and is_plausible(*one) else None for one in poses)
        yaw, mid_yaw = (None if one is None or not is_plausible(one) else one for one in yaws)
        return replace(
            scan,
            laser=last.laser if last is not None and last.laser == scan.laser else scan.laser,
            odometry=odometry,
            yaw=yaw,
            mid_odometry=mid_odometry,
            mid_yaw=mid_yaw,
        )

    def _previous_if_not_newer(self, scan: Scan) -> Estimate | None:
        """The last estimate if the scan is late, or repeated by a laser; None if it is new."""
        t, mount = scan.t, (scan.laser.mount, scan.laser.mount_z)
        others = self._mounts if self.last is not None and t == self.last.t else []
        if self.last is not None and (t < self.last.t or mount in others):
            self._counts["repeated" if t == self.last.t else "late"] += 1
            self._n_late += t < self.last.t
            if self._n_late <= MAX_CONSECUTIVE_LATE:
                self.last = replace(self.last, used=False)
                return self.last
            self._counts["clock_set_back"] += 1
            self._matched_at = t
        self._n_late, self._mounts = 0, [*others, mount]
        return None

    def _estimate(self, scan: Scan, pose: Pose2) -> Estimate:
        """The estimate after a scan; attributes that the algorithm lacks get a default."""
        state = str(getattr(self._slam, "state", None))
        state = state if state in STATES else MATCHED
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
            found=not isinstance(self._slam, GivenMapSlam),
            explained=float(getattr(self._slam, "explained", math.nan)),
        )
