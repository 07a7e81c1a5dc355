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


@njit(inner=True, borrows=True)
def near_chord(points: Points, i: int, mount: Pose2, step: float, max_chord: float) -> float:
    """Distance of end point i from the line through both neighbors [m]; inf if they are apart.

    ours: they are within `max_chord` [m], or twice the spacing of their beams on a wall there.
    """
    x, y = points[0, i] - mount.x, points[1, i] - mount.y
    angle = MAX_CHORD_SPACING * step * (points[2, i + 1] - points[2, i - 1])
    if square_gap(points, i - 1, i + 1) >= max_chord**2 + angle * angle * (x * x + y * y):
        return math.inf
    return abs(beyond_chord(points, i - 1, i, i + 1, mount))


@njit
def beyond_chords(
    points: Points,
    n: int,
    mount: Pose2,
    step: float,
    limits: tuple[float, float],
    out: Floats,
) -> int:
    """Distances of end points from the line through both neighbors [m], out (>= n,); their number.

    ours: on a wall these distances are noise; by the weights of the beams they are those at the
    typical range. Every third end point is used, if its neighbors are within limits[0] [m] (see
    `near_chord`), and the distance within limits[1] [m], else it is off their wall. points
    (4, >= n), `step` [rad] between two beams.
    """
    count = 0
    for i in range(1, n - 1, 3):
        out[count] = near_chord(points, i, mount, step, limits[0]) * math.sqrt(points[3, i])
        count += out[count] < limits[1]
    return count


@njit
def noise_by_range(
    points: Points,
    n: int,
    mount: Pose2,
    step: float,
    limits: tuple[float, float],
    typical: float,
    out: Floats,
) -> None:
    """Sums of distances from chords, for beams up to the `typical` range [m] and beyond.

    ours: as in `beyond_chords`, but not weighted, and only on walls that are straight over twice
    `HALF_WALL`. Beyond the typical range the limit grows with the range, so that it cuts no noise
    that does. out (2, 3): number, sum of distances [m], sum of squared ranges [m^2].
    """
    out[:] = 0.0
    for i in range(1, n - 1, 3):
        x, y = points[0, i] - mount.x, points[1, i] - mount.y
        r = math.sqrt(x * x + y * y)
        is_far = r > typical
        limit = limits[1] * r / typical if is_far and typical > 0.0 else limits[1]
        distance = near_chord(points, i, mount, step, limits[0])
        side = max(int(HALF_WALL / (step * r + 1e-6)), 1)
        a, b = max(i - side, 0), min(i + side, n - 1)
        if distance < limit and abs(beyond_chord(points, a, i, b, mount)) < limit:
            half = 1 if is_far else 0
            out[half, 0] += 1.0
            out[half, 1] += distance
            out[half, 2] += r * r
