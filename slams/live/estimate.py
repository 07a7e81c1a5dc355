"""Estimate: what is known after a scan, whatever the algorithm reports of itself."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from slams.types import Floats, Pose2, Scan, Slam

MATCHED, PREDICTED, LOST = STATES = ("matched", "predicted", "lost")
FAILURES = ("lost", "rejected", "empty")  # counts in reports of algorithms without a state


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
        lost: the scan did not fit the map, the pose is a prediction.
        seconds_lost: for how long that has been so.
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
    lost: bool
    seconds_lost: float
    state: str = MATCHED
    found: bool = True
    explained: float = math.nan


class EstimateMaker:
    """Makes estimates of an algorithm's poses; what it has no attribute for gets a default."""

    def __init__(self, slam: Slam) -> None:
        self._slam = slam
        self._failures = self._count_failures()  # earlier ones are not of the next scan
        self._matched_at = -math.inf

    def estimate(self, scan: Scan, pose: Pose2) -> Estimate:
        """The estimate after a scan; to be called once for each."""
        state = self._state()
        if state != LOST or math.isinf(self._matched_at):
            self._matched_at = scan.t
        covariance = self._get("covariance", None)
        return Estimate(
            t=scan.t,
            pose=pose,
            map_to_odom=None if scan.odometry is None else pose @ scan.odometry.inverse(),
            covariance=np.diag([math.inf] * 3) if covariance is None else np.array(covariance),
            quality=float(self._get("quality", math.nan)),
            used=True,
            lost=state == LOST,
            seconds_lost=scan.t - self._matched_at,
            state=state,
            found=bool(self._get("found", True)),
            explained=float(self._get("explained", math.nan)),
        )

    def restart_clock(self, t: float) -> None:
        """Count the time lost from a stamp [s] on."""
        self._matched_at = t

    def _get(self, name: str, default: Any) -> Any:
        return getattr(self._slam, name, default)

    def _state(self) -> str:
        """The algorithm's own state; without one, lost after a scan that it counts as a failure."""
        before, self._failures = self._failures, self._count_failures()
        state = self._get("state", None)
        name = str(getattr(state, "value", state))
        return name if name in STATES else LOST if self._failures > before else MATCHED

    def _count_failures(self) -> int:
        report = self._slam.report()
        return sum(int(report.get(name, 0)) for name in FAILURES)
