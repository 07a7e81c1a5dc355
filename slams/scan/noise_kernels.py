"""Kernels of the noise of ranges."""

from __future__ import annotations

import math

from slams.jit import njit
from slams.scan.scan_kernels import Points, square_gap
from slams.types import Floats, Pose2

MAX_CHORD_SPACING = 2.0  # of the beams, between two neighbors: a wall at 60 degrees of incidence


@njit(inner=True, borrows=True)
def beyond_chord(points: Points, a: int, i: int, b: int, mount: Pose2) -> float:
    """Distance of end point i behind the line through a and b, along its beam [m]; inf: parallel.

    ours: exactly 0 on a straight wall, at any spacing of the beams and any angle of incidence.
    """
    ax, ay = points[0, a] - mount.x, points[1, a] - mount.y
    px, py = points[0, i] - mount.x, points[1, i] - mount.y
    dx, dy = points[0, b] - points[0, a], points[1, b] - points[1, a]
    across = px * dy - py * dx
    if across == 0.0:
        return math.inf
    met = (ax * dy - ay * dx) / across
    behind: float = (1.0 - met) * math.sqrt(px * px + py * py)
    return behind


@njit
def beyond_chords(
    points: Points,
    n: int,
    mount: Pose2,
    step: float,
    limits: tuple[float, float],
    typical: float,
    out: Floats,
    halves: Floats,
) -> int:
    """Distances of end points from the line through both neighbors [m], out (>= n,); their number.

    ours: on a wall these distances are noise. Every third end point is used, if the line is within
    limits[1] [m], else it is off their wall, and its neighbors are within limits[0] [m] or twice
    the spacing of their beams there. Distances in out are those at the typical range, by the
    weights of the beams. points (4, >= n), `step` [rad] between two beams. halves (2, 3): of the
    beams up to the `typical` range [m] and of the others, the number, and the sums of unweighted
    distances [m] and of squared ranges [m^2].
    """
    count = 0
    halves[:] = 0.0
    for i in range(1, n - 1, 3):
        x, y = points[0, i] - mount.x, points[1, i] - mount.y
        angle = MAX_CHORD_SPACING * step * (points[2, i + 1] - points[2, i - 1])
        square = x * x + y * y
        if square_gap(points, i - 1, i + 1) < limits[0] ** 2 + angle * angle * square:
            distance = abs(beyond_chord(points, i - 1, i, i + 1, mount))
            out[count] = distance * math.sqrt(points[3, i])
            if out[count] < limits[1]:
                count += 1
                half = 1 if square > typical * typical else 0
                halves[half, 0] += 1.0
                halves[half, 1] += distance
                halves[half, 2] += square
    return count
