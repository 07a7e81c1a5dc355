"""Estimate: pose, covariance and state after a scan, the same for all algorithms."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slams.types import Floats, Pose2

MATCHED, PREDICTED, LOST = STATES = ("matched", "predicted", "lost")
MAX_CONSECUTIVE_LATE = 10  # stamps older than the newest; after more the clock was set back


@dataclass(frozen=True)
class Estimate:
    """The algorithm's result after a scan.

    Attributes:
        t: stamp of the scan (of its first beam) [s].
        pose: T_map_base.
        map_to_odom: T_map_odom, as a ROS node publishes it; None for a scan without odometry.
        covariance: of the pose, (3, 3) [m, rad]; inf on the diagonal where the algorithm has none.
        quality: match score of the scan, 0..1; nan where the algorithm has none.
        used: False for a scan that is late or repeated; the previous estimate is given again.
        seconds_lost: time since the last scan that was not lost [s].
        state: "matched", "predicted" (from odometry or motion alone) or "lost"; "matched" where the
            algorithm reports no state.
        found: False during global localization in a given map; the pose is the likeliest one.
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
        """Whether the state is "lost"."""
        return self.state == LOST
