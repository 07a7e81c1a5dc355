"""The walls that the points of a scan lie on."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numpy.typing import NDArray

from slams.jit import njit

LEAST_LINE = 3  # points
SKIPPED_BEAMS = 3  # lost between two neighbors on one wall, at most


class Points(NamedTuple):
    """End points of one scan, in the laser frame; only the first m of each array count.

    xy (n, 2) [m]; normal (n, 2) of the wall, facing the laser, (0, 0) for a lone point; spread
    (n,) [m2] variance of the neighbors across the wall; beam (n,) number of the beam; sums
    (n+1, 5) running sums of x, y, xx, yy, xy over the points.
    """

    xy: NDArray[Any]
    normal: NDArray[Any]
    spread: NDArray[Any]
    beam: NDArray[Any]
    sums: NDArray[Any]


@njit
def is_gap(xy: Any, beam: Any, i: int, gap: Any) -> bool:
    """ours: points i-1 and i lie on different walls; gap (m, factor on the range of point i)."""
    x, y = xy[i, 0], xy[i, 1]
    limit = gap[0] + gap[1] * math.sqrt(x * x + y * y)
    dx, dy = x - xy[i - 1, 0], y - xy[i - 1, 1]
    return bool(dx * dx + dy * dy > limit * limit or beam[i] - beam[i - 1] > SKIPPED_BEAMS)


@njit
def line_through(sums: Any, a: int, b: int) -> Any:
    """ours: total least squares line through points a..b-1 from their running sums.

    Returns (variance across the line [m2], difference and covariance of the axes [m2]).
    """
    n = b - a
    mx = (sums[b, 0] - sums[a, 0]) / n
    my = (sums[b, 1] - sums[a, 1]) / n
    xx = (sums[b, 2] - sums[a, 2]) / n - mx * mx
    yy = (sums[b, 3] - sums[a, 3]) / n - my * my
    xy = (sums[b, 4] - sums[a, 4]) / n - mx * my
    half = 0.5 * (xx - yy)
    least = 0.5 * (xx + yy) - math.sqrt(half * half + xy * xy)
    return max(0.0, least) * n / (n - 2.0), half, xy


@njit
def best_line(sums: Any, a: int, i: int, b: int, good: float) -> Any:
    """ours: line through the neighbors a..b-1 of point i; near a corner, those of one side.

    good [m2]: variance that needs no second look. Returns as `line_through`.
    """
    best, half, xy = 1e9, 0.0, 0.0
    for side in range(3):
        lo = i if side == 2 else a
        hi = i + 1 if side == 1 else b
        if hi - lo >= LEAST_LINE:
            spread, side_half, side_xy = line_through(sums, lo, hi)
            if spread < best:
                best, half, xy = spread, side_half, side_xy
        if best < good:
            break
    return best, half, xy


@njit
def normal_of(half: float, xy: float, x: float, y: float) -> Any:
    """ours: unit normal of a line (see `line_through`) at the point (x, y), facing the origin."""
    length = math.sqrt(half * half + xy * xy)
    # twice the normal's angle points along (-half, -xy)
    nx, ny = math.sqrt(max(0.0, length - half)), math.sqrt(max(0.0, length + half))
    if xy > 0.0:
        nx = -nx
    norm = math.sqrt(nx * nx + ny * ny)
    if norm == 0.0:
        return 0.0, 0.0
    if nx * x + ny * y > 0.0:
        norm = -norm
    return nx / norm, ny / norm


@njit
def find_walls(points: Points, m: int, window: float, gap: Any, limits: Any) -> None:
    """ours: normal and spread of every point, from the neighbors within `window` [m].

    At least two neighbors on either side are taken, none across a gap. limits (variance of a good
    line, variance of a lone point) [m2].
    """
    xy, beam, sums = points.xy, points.beam, points.sums
    spread_out, normal_out = points.spread, points.normal
    w2 = window * window
    a, b = 0, 0
    for i in range(m):
        x, y = xy[i, 0], xy[i, 1]
        if i > 0 and is_gap(xy, beam, i, gap):
            a = i
        while i - a > 2 and (xy[a, 0] - x) ** 2 + (xy[a, 1] - y) ** 2 > w2:
            a += 1
        b = max(b, i + 1)
        while b < m and not is_gap(xy, beam, b, gap):
            if b - i > 2 and (xy[b, 0] - x) ** 2 + (xy[b, 1] - y) ** 2 > w2:
                break
            b += 1
        spread, half, cross = best_line(sums, a, i, b, limits[0])
        nx, ny = 0.0, 0.0
        if spread < limits[1]:
            nx, ny = normal_of(half, cross, x, y)
        spread_out[i] = spread
        normal_out[i, 0] = nx
        normal_out[i, 1] = ny
