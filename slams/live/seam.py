"""Where a live run goes on from a state: what the first scan still has to do with the last one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple, Self

from slams.types import Scan

SAME_DRIVE = 60.0  # [s] after the last scan in which wheels are believed to have counted on
BRIDGED = 1.0  # [s] for which the gyro's last rate tells how the robot turned

Rates = tuple[float, float, float]  # stamp [s], rate [rad/s], heading [rad]
NONE: Rates = (math.nan, 0.0, 0.0)


class Seam(NamedTuple):
    """A state's last stamp [s], nan for none, and the gyro there: pushed readings, and a node's."""

    t: float = math.nan
    heading: Rates = NONE
    gyro: Rates = NONE

    @classmethod
    def of(cls, beside: Mapping[str, Any]) -> Self:
        """What was kept beside an algorithm; nothing of what is not as we keep it."""
        t = beside.get("t")
        stamp = t if isinstance(t, float) else math.nan
        return cls(stamp, _rates(beside.get("heading")), _rates(beside.get("gyro")))

    def joined(self, scan: Scan) -> Scan:
        """The first scan, with odometry and heading as far as they go on from the last one's.

        Wheels and gyro tell differences; a robot that was switched off has begun to count anew.
        """
        gap = scan.t - self.t
        if math.isnan(gap):
            return scan
        odometry = scan.odometry if 0.0 < gap <= SAME_DRIVE else None
        return replace(scan, odometry=odometry, yaw=scan.yaw if 0.0 < gap <= BRIDGED else None)


def _rates(value: Any) -> Rates:
    if isinstance(value, list) and len(value) == 3 and all(isinstance(v, float) for v in value):
        return (value[0], value[1], value[2])
    return NONE
