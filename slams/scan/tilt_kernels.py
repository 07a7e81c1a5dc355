"""Kernels of leveling: end points of a tilted laser, projected to the level plane."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.jit import njit
from slams.scan.scan_kernels import Points
from slams.types import Floats

# the statistics of `level`: numbers of end points, sums of a regression
N_ON_FLOOR, N_BELOW_LEVEL, N_BELOW_FLOOR, SUM_RESIDUAL_RATE, SUM_SQUARED_RATE = range(5)


class Floor(NamedTuple):
    """Position of the laser x, y, z [m] in the base frame, and the height of the floor.

    The floor is `below` [m] under the base's origin, inf where that is unknown. End points within
    `clear` [m] are on a level floor; ramps rise by `rise` [m] and fall by `fall` [m] from it. Each
    limit is extended by `error` [rad] times the range.
    """

    x: float
    y: float
    z: float
    below: float
    clear: float
    rise: float
    fall: float
    error: float


@njit
def level(
    points: Points,
    n: int,
    R: Floats,
    rate: Floats,
    time_increment: float,
    floor: Floor,
    out: Points,
    statistics: Floats,
) -> tuple[int, float]:
    """Project end points of a tilted base to the level plane; their number, the farthest [m].

    [Kohlbrecher11] sec. III: the attitude transforms the scan, end points on the floor are removed.
    points (4, >= n) of `end_points`; out (4, >= n), may be `points`. `R` (3, 3) turns base
    axes level at the first beam, `rate` (3, 3) [1/s] is its change, `time_increment` [s] is per
    beam. ours: end points expected on the floor show errors of an attitude. `statistics` (5,): how
    many are near the floor, below a level floor, and below any floor; of those near the floor the
    sums of slope residual times slope rate and of the squared slope rate.
    """
    kept, square = 0, 0.0
    statistics[:] = 0.0
    z = floor.z
    laser_height = floor.below + R[2, 0] * floor.x + R[2, 1] * floor.y + R[2, 2] * z
    for i in range(n):
        x, y, t = points[0, i], points[1, i], points[2, i] * time_increment
        dx, dy = x - floor.x, y - floor.y
        height_rate = rate[2, 0] * dx + rate[2, 1] * dy
        rise = R[2, 0] * dx + R[2, 1] * dy + t * height_rate
        if rise < 0.0:
            distance = math.sqrt(dx * dx + dy * dy)
            height, tolerance = laser_height + rise, floor.error * distance
            if height < floor.rise + tolerance and -rise > 0.5 * tolerance:
                if height < -floor.fall - tolerance:
                    statistics[N_BELOW_FLOOR] += 1.0
                elif height < -floor.clear - tolerance:
                    statistics[N_BELOW_LEVEL] += 1.0
                elif height < floor.clear + tolerance:
                    statistics[N_ON_FLOOR] += 1.0
                    area = distance * distance
                    statistics[SUM_RESIDUAL_RATE] += height * height_rate / area
                    statistics[SUM_SQUARED_RATE] += height_rate * height_rate / area
                continue
        u = R[0, 0] * x + R[0, 1] * y + R[0, 2] * z
        v = R[1, 0] * x + R[1, 1] * y + R[1, 2] * z
        u += t * (rate[0, 0] * x + rate[0, 1] * y + rate[0, 2] * z)
        v += t * (rate[1, 0] * x + rate[1, 1] * y + rate[1, 2] * z)
        out[0, kept], out[1, kept] = u, v
        out[2, kept], out[3, kept] = points[2, i], points[3, i]
        square = max(square, u * u + v * v)
        kept += 1
    return kept, math.sqrt(square)
