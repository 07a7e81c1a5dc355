"""The walls that the points of a scan lie on."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numpy.typing import NDArray

from slams.jit import njit

LEAST_LINE = 3  # points
NO_LINE = 1e9  # m2
SKIPPED_BEAMS = 3  # lost between two neighbors on one wall, at most


class Points(NamedTuple):
    """End points of one scan, in the base frame; only the first m of each array count.

    xy (n+1, 2) [m]; normal (n, 2) of the wall, facing the laser, (0, 0) for a lone point; spread
    (n,) [m2] variance of the neighbors across the wall; first (n+1,) the first point of the same
    stretch without a gap, -1 after the last; sums (n+1, 5) running sums of x, y, xx, yy, xy over
    the points; wall (n, 2) cell (ix, iy) of the wall in the map that the point was last found on,
    (0, 0) for none.
    """

    xy: NDArray[Any]
    normal: NDArray[Any]
    spread: NDArray[Any]
    first: NDArray[Any]
    sums: NDArray[Any]
    wall: NDArray[Any]


@njit(inner=True)
def end_of(ranges: Any, beams: Any, limits: Any, i: int) -> Any:
    """ours: end point of beam i (x, y) [m]; infinitely far where there is none."""
    if i >= min(ranges.shape[0], beams.shape[0]) or not limits[0] <= ranges[i] < limits[1]:
        return math.inf, math.inf
    r = ranges[i]
    return r * beams[i, 0] + beams[i, 2], r * beams[i, 1] + beams[i, 3]


@njit(inner=True)
def is_near(ax: float, ay: float, bx: float, by: float, limit: float) -> bool:
    """ours: whether two points are within a limit [m] of each other."""
    dx, dy = ax - bx, ay - by
    return dx * dx + dy * dy <= limit * limit


@njit
def end_points(ranges: Any, beams: Any, limits: Any, gap: Any, points: Points) -> Any:
    """[Tsardoulias13] cleaning: end points of the ranges (n,) with limits[0] <= range < limits[1].

    beams (n, 4): direction x, y and start x, y [m] of each; a stretch is torn where neighbors are
    further apart than gap (m, factor on the range). A single beam that ends elsewhere than those on
    both sides of it does not tear them: it comes after all others. Returns how many points, and how
    far [m].
    """
    xy, sums = points.xy, points.sums
    m, start, last, reach2, odd = 0, 0, 0, 0.0, 0
    sx = sy = sxx = syy = sxy = 0.0
    before_x = before_y = math.inf
    for i in range(min(ranges.shape[0], beams.shape[0])):
        x, y = end_of(ranges, beams, limits, i)
        if x == math.inf:
            continue
        limit = gap[0] + gap[1] * ranges[i]
        if not is_near(x, y, before_x, before_y, limit) or i - last > SKIPPED_BEAMS:
            next_x, next_y = end_of(ranges, beams, limits, i + 1)
            then_x, then_y = end_of(ranges, beams, limits, i + 2)
            goes_on = is_near(next_x, next_y, before_x, before_y, limit)
            goes_on |= is_near(then_x, then_y, before_x, before_y, limit)
            if goes_on and not is_near(x, y, next_x, next_y, limit):
                points.wall[odd, 1] = i
                odd += 1
                continue
            start = m
        last, before_x, before_y = i, x, y
        xy[m, 0], xy[m, 1], points.first[m] = x, y, start
        m += 1
        reach2 = max(reach2, x * x + y * y)
        sx, sy, sxx, syy, sxy = sx + x, sy + y, sxx + x * x, syy + y * y, sxy + x * y
        sums[m, 0], sums[m, 1], sums[m, 2], sums[m, 3], sums[m, 4] = sx, sy, sxx, syy, sxy
    for k in range(odd):
        x, y = end_of(ranges, beams, limits, points.wall[k, 1])
        xy[m, 0], xy[m, 1], points.first[m] = x, y, m
        m += 1
        reach2 = max(reach2, x * x + y * y)
        for j in range(5):
            sums[m, j] = sums[m - 1, j]
    points.wall[:m] = 0
    points.first[m] = -1
    return m, math.sqrt(reach2)


@njit(inner=True)
def line_through(sums: Any, a: int, b: int) -> Any:
    """ours: total least squares line through points a..b-1 from their running sums.

    Returns (variance across the line [m2], difference and covariance of the axes [m2]).
    """
    n = b - a
    if n < LEAST_LINE:
        return NO_LINE, 0.0, 0.0
    mx, my = (sums[b, 0] - sums[a, 0]) / n, (sums[b, 1] - sums[a, 1]) / n
    xx = (sums[b, 2] - sums[a, 2]) / n - mx * mx
    yy = (sums[b, 3] - sums[a, 3]) / n - my * my
    xy = (sums[b, 4] - sums[a, 4]) / n - mx * my
    half = 0.5 * (xx - yy)
    least = yy + half - math.sqrt(half * half + xy * xy)
    return max(0.0, least) * n / (n - 2.0), half, xy


@njit(inner=True)
def best_line(sums: Any, a: int, i: int, b: int, good: float) -> Any:
    """ours: line through the neighbors a..b-1 of point i; near a corner, those of one side.

    good [m2]: variance that needs no second look. Returns as `line_through`.
    """
    best = line_through(sums, a, b)
    if best[0] > good:
        left, right = line_through(sums, a, i + 1), line_through(sums, i, b)
        if left[0] < best[0]:
            best = left
        if right[0] < best[0]:
            best = right
    return best


@njit(inner=True)
def normal_of(half: float, xy: float, x: float, y: float) -> Any:
    """ours: unit normal of a line (see `line_through`) at the point (x, y), against (x, y)."""
    length = math.sqrt(half * half + xy * xy)
    # two ways to write one eigenvector: the one without a difference of like numbers
    nx, ny = (-xy, length + half) if half > 0.0 else (length - half, -xy)
    norm = -math.copysign(math.sqrt(nx * nx + ny * ny), nx * x + ny * y)
    return (nx / norm, ny / norm) if norm != 0.0 else (0.0, 0.0)


@njit
def find_walls(points: Points, m: int, window2: float, limits: Any, laser: Any) -> None:
    """ours: normal and spread of every point, from its neighbors; normals face the laser (x, y).

    The neighbors are those of its stretch within a distance, window2 its square [m2], and two on
    either side at least. limits (variance of a good line, variance of a lone point) [m2].
    """
    xy, first, normal, spread = points.xy, points.first, points.normal, points.spread
    a, b = 0, 0
    for i in range(m):
        x, y = xy[i, 0], xy[i, 1]
        a, b = max(a, first[i]), max(b, i + 1)
        while (i - a > 2) & ((xy[a, 0] - x) ** 2 + (xy[a, 1] - y) ** 2 > window2):
            a += 1
        while (first[b] == first[i]) & (
            (b - i <= 2) | ((xy[b, 0] - x) ** 2 + (xy[b, 1] - y) ** 2 <= window2)
        ):
            b += 1
        variance, half, cross = best_line(points.sums, a, i, b, limits[0])
        nx, ny = normal_of(half, cross, x - laser[0], y - laser[1])
        wall = variance < limits[1]
        spread[i], normal[i, 0], normal[i, 1] = variance, wall * nx, wall * ny
