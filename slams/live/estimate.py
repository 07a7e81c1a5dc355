"""Estimate: what is known after a scan, whatever the algorithm tells of itself."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slams.types import Floats, Pose2, Slam

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


class Confidence:
    """What an algorithm says of its last pose; where it says nothing, what its counts say."""

    def __init__(self) -> None:
        self._failures = 0

    def state(self, slam: Slam) -> str:
        """One of `STATES`; call it once for every scan."""
        told, failed = getattr(slam, "state", None), self._has_failed(slam)
        word = str(getattr(told, "value", told))
        if word in STATES:
            return word
        return LOST if failed else MATCHED

    def _has_failed(self, slam: Slam) -> bool:
        """Whether the algorithm counts one failure more than before."""
        report = slam.report()
        failures = sum(int(report.get(name, 0)) for name in FAILURES)
        failed = failures > self._failures
        self._failures = failures
        return failed


def quality(slam: Slam) -> float:
    """Share of the last scan that agrees with the map, 0..1; nan where there is none."""
    return float(getattr(slam, "quality", math.nan))


def covariance(slam: Slam) -> Floats:
    """Of the last pose, (3, 3) [m, rad]; inf on the diagonal where there is none."""
    found = getattr(slam, "covariance", None)
    return np.diag([math.inf] * 3) if found is None else np.array(found, np.float64)
