"""Estimate: what is known after a scan, whatever the algorithm reports of itself."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from slams.types import Floats, Pose2, Scan, Slam

MATCHED, PREDICTED, LOST = STATES = ("matched", "predicted", "lost")
FAILURES = ("lost", "rejected", "empty")  # counts in reports of algorithms without a state
LATE_IN_A_ROW = 10  # after so many scans from the past the clock was set back


@dataclass(frozen=True)
class Estimate:
    """What is known after a scan.

    Attributes:
        t: stamp of the scan the pose belongs to (its first beam) [s].
        pose: T_map_base.
        map_to_odom: T_map_odom, what a ROS node publishes; None for a scan without odometry.
        covariance: of the pose, (3, 3) [m, rad]; inf on the diagonal where the algorithm has none.
        quality: share of the scan that agrees with the map, 0..1; nan where there is none.
        used: False for a scan from the past or sent twice: the estimate before is repeated.
        seconds_lost: for how long the scans have not fitted the map.
        state: "matched", "predicted" (from odometry or motion alone) or "lost".
        found: False while the place in a given map is sought; the pose is the likeliest one.
        explained: share of the scan that a given map explains, 0..1; nan without such a map.
    """

    t: float
    pose: Pose2
    map_to_odom: Pose2 | None
    covariance: Floats
    quality: float
    used: bool
    seconds_lost: float
    state: str = MATCHED
    found: bool = True
    explained: float = math.nan

    @property
    def lost(self) -> bool:
        """Whether the scan did not fit the map: the pose is a prediction."""
        return self.state == LOST


class Estimates:
    """Makes estimates of an algorithm's poses; what it has no attribute for gets a default.

    `last` is the newest; `counts` gets what is wrong with stamps.
    """

    def __init__(self, slam: Slam, counts: dict[str, int]) -> None:
        self.last: Estimate | None = None
        self._slam, self._counts = slam, counts
        self._failures = self._count_failures()  # earlier ones are not of the next scan
        self._matched_at, self._late = -math.inf, 0

    def again(self, t: float) -> Estimate | None:
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

    def add(self, scan: Scan, pose: Pose2) -> Estimate:
        """The estimate after a scan; to be called once for each."""
        state = self._state()
        if state != LOST or math.isinf(self._matched_at):
            self._matched_at = scan.t
        covariance = getattr(self._slam, "covariance", None)
        self.last = Estimate(
            t=scan.t,
            pose=pose,
            map_to_odom=None if scan.odometry is None else pose @ scan.odometry.inverse(),
            covariance=np.diag([math.inf] * 3) if covariance is None else np.array(covariance),
            quality=float(getattr(self._slam, "quality", math.nan)),
            used=True,
            seconds_lost=scan.t - self._matched_at,
            state=state,
            found=bool(getattr(self._slam, "found", True)),
            explained=float(getattr(self._slam, "explained", math.nan)),
        )
        return self.last

    def _state(self) -> str:
        """The algorithm's own state; without one, lost after a scan that it counts as a failure."""
        before, self._failures = self._failures, self._count_failures()
        state = str(getattr(self._slam, "state", None))
        return state if state in STATES else LOST if self._failures > before else MATCHED

    def _count_failures(self) -> int:
        report = self._slam.report()
        return sum(int(report.get(name, 0)) for name in FAILURES)
