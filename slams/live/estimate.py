"""Estimate: what is known after a scan, whatever the algorithm reports of itself."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slams.types import Floats, Pose2

MATCHED, PREDICTED, LOST = STATES = ("matched", "predicted", "lost")
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
        state: "matched", "predicted" (from odometry or motion alone) or "lost"; "matched" where the
            algorithm does not tell.
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
