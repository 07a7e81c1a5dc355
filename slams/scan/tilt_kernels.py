"""Kernels of tilt: end points of a laser that is not level, projected to the plane."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.jit import njit
from slams.scan.scan_kernels import Points
from slams.types import Floats

HITS, DEEP, BELOW, LATE, SWUNG = range(5)  # of what `level` finds of the floor


class Floor(NamedTuple):
    """The laser x, y, z [m] in the base frame, and the floor `below` [m] under the base's origin.

    `below` is inf where it is not known. Ends within `clear` [m] of it are of a level floor; ramps
    rise by `rise` [m] and fall by `fall` [m] from there. All are wider by `error` [rad] times the
    range.
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
    start: Floats,
    rate: Floats,
    per_beam: float,
    floor: Floor,
    out: Points,
    found: Floats,
) -> tuple[int, float]:
    """Project end points of a tilted base to the level plane; how many are left, the farthest [m].

    [Kohlbrecher11] sec. III: scans are transformed by the attitude, ends at the floor left out.
    points (3, >= n) of `end_points`, out (3, >= n) the same or others. `start` (3, 3) turns base
    axes level at the first beam, `rate` (3, 3) [1/s] is its change, `per_beam` [s] the time from
    beam to beam. ours: `found` (5,) tells what is wrong with an attitude, by the ends that should
    be of the floor: how many are near it, how many deeper, how many too deep for any floor, and the
    sums of residual times rate and of the squared rate of the slope of the beams near it.
    """
    kept, square = 0, 0.0
    found[:] = 0.0
    z = floor.z
    above_floor = floor.below + start[2, 0] * floor.x + start[2, 1] * floor.y + start[2, 2] * z
    for i in range(n):
        x, y, t = points[0, i], points[1, i], points[2, i] * per_beam
        dx, dy = x - floor.x, y - floor.y
        swing = rate[2, 0] * dx + rate[2, 1] * dy
        rise = start[2, 0] * dx + start[2, 1] * dy + t * swing
        if rise < 0.0:
            distance = math.sqrt(dx * dx + dy * dy)
            above, blur = above_floor + rise, floor.error * distance
            if above < floor.rise + blur and -rise > 0.5 * blur:
                if above < -floor.fall - blur:
                    found[BELOW] += 1.0
                elif above < -floor.clear - blur:
                    found[DEEP] += 1.0
                elif above < floor.clear + blur:
                    found[HITS] += 1.0
                    found[LATE] += above * swing / (distance * distance)
                    found[SWUNG] += swing * swing / (distance * distance)
                continue
        u = start[0, 0] * x + start[0, 1] * y + start[0, 2] * z
        v = start[1, 0] * x + start[1, 1] * y + start[1, 2] * z
        u += t * (rate[0, 0] * x + rate[0, 1] * y + rate[0, 2] * z)
        v += t * (rate[1, 0] * x + rate[1, 1] * y + rate[1, 2] * z)
        out[0, kept], out[1, kept], out[2, kept] = u, v, points[2, i]
        square = max(square, u * u + v * v)
        kept += 1
    return kept, math.sqrt(square)
