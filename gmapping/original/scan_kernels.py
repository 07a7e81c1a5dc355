"""From ranges to points."""

from __future__ import annotations

import math

from slams.jit import njit
from slams.types import Floats, Pose2, Ranges


@njit
def end_points(
    ranges: Ranges, directions: Floats, mount: Pose2, limits: tuple[float, float], out: Floats
) -> int:
    """End points [m] of the beams with a return, in the base frame.

    Original code. ranges (n,) m, directions (n, 2), `limits` least and greatest range used [m],
    out (>= n, 2); returns how many.
    """
    c, s = math.cos(mount.theta), math.sin(mount.theta)
    near, far = limits
    n = 0
    for i in range(min(ranges.shape[0], directions.shape[0])):
        r = ranges[i]
        if not (r >= near and r < far):
            continue
        lx, ly = r * directions[i, 0], r * directions[i, 1]
        out[n, 0], out[n, 1] = mount.x + c * lx - s * ly, mount.y + s * lx + c * ly
        n += 1
    return n
