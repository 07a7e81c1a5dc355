"""From end points to surface elements: a line fitted to the neighborhood of each end point."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.jit import FAST, njit
from slams.scan.noise_kernels import beyond_chord
from slams.scan.scan_kernels import Points
from slams.types import Floats, Pose2

MAX_SURFACE_GAP_BEAMS, MAX_SURFACE_GAP = 3.0, 0.3  # beams, m: a gap above both ends a surface
MAX_FLAT_VARIANCE_RATIO = 1.5  # of a line to the range noise; a window below it has no corner
COLLINEAR_DEVIATIONS = 4.0  # standard deviations of the range noise, along a beam
MIN_HALF_WINDOW_HITS = 2.0  # fewer hits in half a window determine no normal


class Beams(NamedTuple):
    """Position of the laser on the base [m], angle between its beams [rad]."""

    mount_x: float
    mount_y: float
    angle_increment: float


class SurfaceRule(NamedTuple):
    """Criteria of one surface.

    Half window of a line [m], range noise [m], cotangent of the angle of a range jump, variance
    [m2] above which a surface is rough, beam width in beam spacings, gap [m] between beams up to
    which an isolated hit is a surface, whether other isolated hits are kept, without a normal.
    """

    window: float
    noise: float
    max_slope: float
    max_variance: float
    beam_width: float
    max_gap: float
    keep_isolated: bool


@njit(fastmath=FAST, inner=True)
def fit_line(sums: Floats, a: int, b: int) -> tuple[float, float, float, float, float]:
    """Total least squares line through hits a..b-1: center x, y, normal x, y, variance [m2].

    ours: PCA as in the published normals, by running sums.
    """
    n = float(b - a)
    mx = (sums[0, b] - sums[0, a]) / n
    my = (sums[1, b] - sums[1, a]) / n
    xx = (sums[2, b] - sums[2, a]) / n - mx * mx
    xy = (sums[3, b] - sums[3, a]) / n - mx * my
    yy = (sums[4, b] - sums[4, a]) / n - my * my
    half = 0.5 * (xx - yy)
    root = math.sqrt(half * half + xy * xy) + 1e-300
    variance = max(0.5 * (xx + yy) - root, 0.0)
    tx = math.sqrt(max(0.5 * (1.0 + half / root), 0.0))
    ty = math.copysign(math.sqrt(max(0.5 * (1.0 - half / root), 0.0)), xy)
    return mx, my, -ty, tx, variance * n / max(n - 2.0, 0.5)


@njit(fastmath=FAST, inner=True)
def fit_best_line(
    sums: Floats, k: int, half_window: int, first: int, last: int, flat: float
) -> tuple[float, float, float, float, float]:
    """Line at hit k from the window around, before or after k with the least variance.

    ours: near a corner, one of the three windows lies on one surface only. A window around k with
    a variance below `flat` [m2] has no corner, and the other two are not tried.
    """
    best = fit_line(sums, max(k - half_window, first), min(k + half_window + 1, last))
    if best[4] < flat:
        return best
    limit = 0.5 * best[4]
    before, after = max(k - 2 * half_window, first), min(k + 2 * half_window + 1, last)
    if k + 1 - before > 2 * min(half_window, 1):
        side = fit_line(sums, before, k + 1)
        if side[4] < limit:
            best, limit = side, side[4]
    if after - k > 2 * min(half_window, 1):
        side = fit_line(sums, k, after)
        if side[4] < limit:
            best = side
    return best


@njit(inner=True)
def are_collinear(points: Points, n: int, first: int, beams: Beams, noise: float) -> bool:
    """Whether three hits of adjacent beams lie on one line, up to the range noise.

    ours: far along a corridor the hits on a wall are a meter apart. If each were a surface of its
    own with a normal towards the laser, the surfaces would move with the robot and hide its motion.
    """
    if first < 0 or first + 2 >= n or points[2, first + 2] - points[2, first] > 4.0:
        return False
    mount = Pose2(beams.mount_x, beams.mount_y, 0.0)
    distance = abs(beyond_chord(points, first, first + 1, first + 2, mount))
    return distance < COLLINEAR_DEVIATIONS * noise


@njit(inner=True)
def are_connected(points: Points, a: int, b: int, beams: Beams, rule: SurfaceRule) -> bool:
    """Whether hit a and a later hit b can lie on one surface, by their ranges.

    ours: the published 3 degree jump test, with a margin for range noise and grazing incidence.
    """
    ra = math.hypot(points[0, a] - beams.mount_x, points[1, a] - beams.mount_y)
    rb = math.hypot(points[0, b] - beams.mount_x, points[1, b] - beams.mount_y)
    steps = points[2, b] - points[2, a]
    spacing = min(ra, rb) * abs(beams.angle_increment) * steps
    near = steps <= MAX_SURFACE_GAP_BEAMS or spacing < MAX_SURFACE_GAP
    return bool(near and abs(rb - ra) <= rule.max_slope * spacing + 4.0 * rule.noise)


@njit
def find_runs(points: Points, n: int, beams: Beams, rule: SurfaceRule, out_first: Floats) -> None:
    """Segment the scan into surfaces: out_first (n + 1,), first hit of each hit's surface. ours."""
    first = 0
    for k in range(1, n):
        if (
            not are_connected(points, k - 1, k, beams, rule)
            and not are_collinear(points, n, k - 2, beams, rule.noise)
            and not are_collinear(points, n, k - 1, beams, rule.noise)
        ):
            first = k
        out_first[k] = first
    out_first[0], out_first[n] = 0, n


@njit(fastmath=FAST)
def fit_surfaces(
    points: Points,
    count: int,
    sums: Floats,
    firsts: Floats,
    beams: Beams,
    rule: SurfaceRule,
    spacing: float,
    out_surfaces: Floats,
) -> int:
    """Surface elements every `spacing` [m] along a surface; returns their number.

    ours: a line through many hits has less noise than one hit. An isolated hit between beams that
    are far apart may lie on a wall of any direction. With a normal towards the laser the element
    would move with the robot, so it has no normal (0, 0) or is left out.

    points (4, n), sums (6, n + 1) of `scan_moments`, firsts (n + 1,) of `find_runs`. out_surfaces
    (n, 8): x, y [m], normal x, y (towards the laser), information [1/m2] of its beams, index of
    its hit, number of its beams, 1 if the hits are dense enough to determine the normal.
    """
    n_elements, k, last = 0, 0, 0
    flat = MAX_FLAT_VARIANCE_RATIO * rule.noise * rule.noise
    while k < count:
        rx, ry = beams.mount_x - points[0, k], beams.mount_y - points[1, k]
        step_length = max(math.sqrt(rx * rx + ry * ry) * abs(beams.angle_increment), 1e-6)
        half = max(int(rule.window / step_length), 2)
        first = int(firsts[k])
        while last <= k or (last < count and firsts[last] == first):
            last += 1
        stride = min(max(int(spacing / step_length), 1), last - k)
        center = k + stride // 2
        rx, ry = beams.mount_x - points[0, center], beams.mount_y - points[1, center]
        r = math.sqrt(rx * rx + ry * ry) + 1e-9
        isolated, noise_variance = False, rule.noise * rule.noise / points[3, center]
        if last - first >= 3:
            while True:
                mx, my, nx, ny, variance = fit_best_line(sums, center, half, first, last, flat)
                if variance <= rule.max_variance or half <= 1:
                    break
                half = half // 2
            if variance > rule.max_variance:
                mx, my = points[0, center], points[1, center]
        else:
            isolated = step_length > rule.max_gap
            mx, my, nx, ny = points[0, center], points[1, center], rx / r, ry / r
            variance = 9.0 * noise_variance
        cosine = (rx * nx + ry * ny) / r
        if cosine < 0.0:
            nx, ny, cosine = -nx, -ny, -cosine
        offset = nx * (points[0, center] - mx) + ny * (points[1, center] - my)
        blur = rule.beam_width * step_length
        oblique = blur * blur * max(1.0 - cosine * cosine, 0.0)
        floor = noise_variance * max(cosine * cosine, 0.04) + oblique
        if cosine > 0.05 and (rule.keep_isolated or not isolated):
            dense = MIN_HALF_WINDOW_HITS * step_length < rule.window
            out_surfaces[n_elements, 0] = points[0, center] - offset * nx
            out_surfaces[n_elements, 1] = points[1, center] - offset * ny
            out_surfaces[n_elements, 2] = 0.0 if isolated else nx
            out_surfaces[n_elements, 3] = 0.0 if isolated else ny
            out_surfaces[n_elements, 4] = stride / max(variance, floor)
            out_surfaces[n_elements, 5] = center
            out_surfaces[n_elements, 6] = stride
            out_surfaces[n_elements, 7] = 1.0 if dense else 0.0
            n_elements += 1
        k += stride
    return n_elements
