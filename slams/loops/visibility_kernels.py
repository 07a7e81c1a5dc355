"""Kernel of the verification of a match: which end points does another scan see?

[LuMilios97] F. Lu, E. Milios: Globally Consistent Range Scan Alignment for Environment Mapping.
Autonomous Robots 4, 1997.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats, Pose2

INLIER, CONFLICT = 1, 2  # bits
VISIBILITY_TOLERANCE = 0.15  # m that the ranges of two scans to one wall may differ


@njit
def check_visibility(
    points: Floats,
    pose: Pose2,
    ranges: Floats,
    fan: tuple[float, float, float],
    out: NDArray[np.uint8],
) -> None:
    """Mark the points that are inliers of a scan, or in conflict with its free space [LuMilios97].

    A point within the ranges of the neighboring beams is an inlier. A point that all of these beams
    passed is a conflict. A hidden point is neither. points (2, n) [m] and their pose in the laser's
    frame; ranges (m,) [m]; fan: first angle, step [rad], largest range [m]; out (n,) gains bits.
    """
    first, step, range_max = fan
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    for i in range(points.shape[1]):
        x = pose.x + c * points[0, i] - s * points[1, i]
        y = pose.y + s * points[0, i] + c * points[1, i]
        angle = math.copysign(1.0, step) * (math.atan2(y, x) - first)
        beam = int(angle % (2.0 * math.pi) / abs(step) + 0.5)
        if beam >= len(ranges):
            continue
        low, high = math.inf, 0.0
        for k in range(max(beam - 1, 0), min(beam + 2, len(ranges))):
            if not math.isnan(ranges[k]):
                measured = min(ranges[k], range_max)
                low, high = min(low, measured), max(high, measured)
        r = math.sqrt(x * x + y * y)
        tolerance = VISIBILITY_TOLERANCE + abs(step) * r
        if low < range_max and low - tolerance <= r <= high + tolerance:
            out[i] |= INLIER
        elif high > 0.0 and r < low - tolerance:
            out[i] |= CONFLICT
