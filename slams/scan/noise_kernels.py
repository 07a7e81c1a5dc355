"""Kernels of the noise of ranges."""

from __future__ import annotations

import math

from slams.jit import njit
from slams.scan.scan_kernels import Points, square_gap
from slams.types import Floats, Pose2

MAX_CHORD_SPACING = 2.0  # of the beams, between two neighbors: a wall at 60 degrees of incidence
HALF_WALL = 0.25  # m of wall to either side of an end point: more than the legs of people have


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
    limits: tuple[float, float, float],
    out: Floats,
    halves: Floats,
) -> int:
    """Distances of end points from the line through both neighbors [m], out (>= n,); their number.

    ours: on a wall these distances are noise. Every third end point is used, if the line is within
    limits[1] [m], else it is off their wall, and its neighbors are within limits[0] [m] or twice
    the spacing of their beams there. Distances in out are those at the typical range limits[2] [m],
    by the weights of the beams. points (4, >= n), `step` [rad] between two beams. halves (2, 3): of
    the end points on straight walls up to the typical range and beyond, the number, and the sums of
    distances [m], as measured, and of squared ranges [m^2]. Farther than the typical range the
    limit grows with the range, so that it cuts no noise that does.
    """
    count = 0
    halves[:] = 0.0
    for i in range(1, n - 1, 3):
        x, y = points[0, i] - mount.x, points[1, i] - mount.y
        angle = MAX_CHORD_SPACING * step * (points[2, i + 1] - points[2, i - 1])
        square = x * x + y * y
        if square_gap(points, i - 1, i + 1) >= limits[0] ** 2 + angle * angle * square:
            continue
        distance = abs(beyond_chord(points, i - 1, i, i + 1, mount))
        out[count] = distance * math.sqrt(points[3, i])
        if out[count] < limits[1]:
            count += 1
        r = math.sqrt(square)
        limit = limits[1] * max(1.0, r / limits[2]) if limits[2] > 0.0 else limits[1]
        side = max(int(HALF_WALL / (step * r + 1e-6)), 1)
        a, b = max(i - side, 0), min(i + side, n - 1)
        if max(distance, abs(beyond_chord(points, a, i, b, mount))) < limit:
            half = 1 if r > limits[2] else 0
            halves[half, 0] += 1.0
            halves[half, 1] += distance
            halves[half, 2] += square
    return count
