"""From end points to surfaces: the line through each hit's neighborhood."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.jit import FAST, njit
from slams.scan.scan_kernels import Points
from slams.types import Floats

SMOOTH = 1.5  # variances of the noise, below which a window has no corner
FEW = 2.0  # hits to either side in a window, below which they do not tell a normal of their own
GAP, NEAR = 3.0, 0.3  # beams from hit to hit, or m, beyond which a surface ends


class Beams(NamedTuple):
    """A laser as the kernels see it: where it is on the base [m], angle between beams [rad]."""

    mount_x: float
    mount_y: float
    angle_increment: float


class SurfaceRule(NamedTuple):
    """What counts as one surface.

    Window [m], range noise [m], jump angle's cotangent, variance [m2] of a rough one, blur across
    in beam spacings, widest gap [m] to the next beam at which a hit alone is a surface; whether one
    that is none is kept, without a normal.
    """

    window: float
    noise: float
    max_slope: float
    rough: float
    beam_width: float
    widest: float
    keeps_alone: bool


@njit(inner=True)
def hits_of(points: Points, n: int, beams: Beams, out_hits: Floats) -> None:
    """End points (3, >= n) with their distances from the laser. ours: a scan is read once.

    out_hits (>= n, 4): x, y [m] in the base frame, range [m], number of the beam.
    """
    for k in range(n):
        x, y = points[0, k], points[1, k]
        dx, dy = x - beams.mount_x, y - beams.mount_y
        out_hits[k, 0], out_hits[k, 1] = x, y
        out_hits[k, 2], out_hits[k, 3] = math.sqrt(dx * dx + dy * dy), points[2, k]


@njit(inner=True)
def in_line(hits: Floats, a: int, b: int, c: int, beams: Beams, noise: float) -> bool:
    """Whether hits a, b, c, of beams side by side, lie on one line up to noise.

    ours: far along a corridor hits are a meter apart, and still on one wall. Taken for a surface
    each, facing the laser, they move with the robot and hold it where it is. Any three hits are
    in line to within the gap between their beams, so they must be so to a fifth of that.
    """
    if hits[c, 3] - hits[a, 3] > 4.0:
        return False
    bx, by = hits[b, 0] - hits[a, 0], hits[b, 1] - hits[a, 1]
    cx, cy = hits[c, 0] - hits[a, 0], hits[c, 1] - hits[a, 1]
    chord = math.sqrt(cx * cx + cy * cy) + 1e-9
    rx, ry = hits[b, 0] - beams.mount_x, hits[b, 1] - beams.mount_y
    cosine = abs(cx * ry - cy * rx) / (chord * hits[b, 2] + 1e-9)
    off = abs(cx * by - cy * bx) / chord
    gap = hits[b, 2] * abs(beams.angle_increment)
    return bool(off < 4.0 * noise * max(cosine, 0.05) and off < 0.2 * gap)


@njit(inner=True)
def side_by_side(hits: Floats, a: int, b: int, beams: Beams, rule: SurfaceRule) -> bool:
    """Whether hit a and a later one b may be of one surface, by their ranges.

    ours: the published 3 degree jump test, with room for range noise, and for grazing walls.
    """
    steps = hits[b, 3] - hits[a, 3]
    spacing = min(hits[b, 2], hits[a, 2]) * abs(beams.angle_increment) * steps
    jump = abs(hits[b, 2] - hits[a, 2])
    return bool(
        (steps <= GAP or spacing < NEAR) and jump <= rule.max_slope * spacing + 4.0 * rule.noise
    )


@njit(inner=True)
def find_runs(hits: Floats, count: int, beams: Beams, rule: SurfaceRule, out_runs: Floats) -> None:
    """First and one-past-last hit of the unbroken surface every hit lies on. ours.

    out_runs (n, 2).
    """
    start = 0
    for k in range(1, count + 1):
        broken = k == count or not side_by_side(hits, k - 1, k, beams, rule)
        if broken and 1 < k < count:
            broken = not in_line(hits, k - 2, k - 1, k, beams, rule.noise)
        if broken and k + 1 < count:
            broken = not in_line(hits, k - 1, k, k + 1, beams, rule.noise)
        if broken:
            for j in range(start, k):
                out_runs[j, 0] = start
                out_runs[j, 1] = k
            start = k


@njit(inner=True)
def sum_moments(hits: Floats, count: int, out_sums: Floats) -> None:
    """Running sums of 1, x, y, xx, xy, yy, so that any window's moments cost O(1). ours."""
    for i in range(5):
        out_sums[0, i] = 0.0
    for k in range(count):
        x, y = hits[k, 0], hits[k, 1]
        out_sums[k + 1, 0] = out_sums[k, 0] + x
        out_sums[k + 1, 1] = out_sums[k, 1] + y
        out_sums[k + 1, 2] = out_sums[k, 2] + x * x
        out_sums[k + 1, 3] = out_sums[k, 3] + x * y
        out_sums[k + 1, 4] = out_sums[k, 4] + y * y


@njit(fastmath=FAST, inner=True)
def fit_line(sums: Floats, a: int, b: int) -> tuple[float, float, float, float, float]:
    """Total least squares line through hits a..b-1: center x, y, normal x, y, variance [m2].

    ours: PCA as in the published normals, by running sums.
    """
    n = float(b - a)
    mx = (sums[b, 0] - sums[a, 0]) / n
    my = (sums[b, 1] - sums[a, 1]) / n
    xx = (sums[b, 2] - sums[a, 2]) / n - mx * mx
    xy = (sums[b, 3] - sums[a, 3]) / n - mx * my
    yy = (sums[b, 4] - sums[a, 4]) / n - my * my
    half = 0.5 * (xx - yy)
    root = math.sqrt(half * half + xy * xy) + 1e-300
    variance = max(0.5 * (xx + yy) - root, 0.0)
    tx = math.sqrt(max(0.5 * (1.0 + half / root), 0.0))
    ty = math.copysign(math.sqrt(max(0.5 * (1.0 - half / root), 0.0)), xy)
    return mx, my, -ty, tx, variance * n / max(n - 2.0, 0.5)


@njit(fastmath=FAST, inner=True)
def fit_best_line(
    sums: Floats, k: int, reach: int, first: int, last: int, smooth: float
) -> tuple[float, float, float, float, float]:
    """The line of hit k from the window around, before or after it: the smoothest one.

    ours: near a corner one of the three windows lies on one surface only; where the one around is
    of a variance below `smooth` [m2] there is no corner.
    """
    best = fit_line(sums, max(k - reach, first), min(k + reach + 1, last))
    if best[4] < smooth:
        return best
    limit = 0.5 * best[4]
    before, after = max(k - 2 * reach, first), min(k + 2 * reach + 1, last)
    if k + 1 - before > 2 * min(reach, 1):
        side = fit_line(sums, before, k + 1)
        if side[4] < limit:
            best, limit = side, side[4]
    if after - k > 2 * min(reach, 1):
        side = fit_line(sums, k, after)
        if side[4] < limit:
            best = side
    return best


@njit(fastmath=FAST)
def fit_surfaces(
    hits: Floats,
    count: int,
    runs: Floats,
    sums: Floats,
    beams: Beams,
    rule: SurfaceRule,
    spacing: float,
    out_surfaces: Floats,
) -> int:
    """Surface elements every `spacing` [m]: point on the local line, normal, information.

    ours: lines through many hits are less noisy than a hit. out_surfaces (n, 8): x, y [m], normal
    x, y (towards the laser), information [1/m2] of the beams it stands for, index of its hit, how
    many beams, 1 if hits are close enough to tell its normal. One hit alone where beams are far
    apart may lie on a wall of any direction: taken to face the laser it would move with the robot.
    It has no normal (0, 0), or is left out.
    """
    n_elements, k = 0, 0
    smooth = SMOOTH * rule.noise * rule.noise
    while k < count:
        step_length = max(hits[k, 2] * abs(beams.angle_increment), 1e-6)
        reach = max(int(rule.window / step_length), 2)
        first, last = int(runs[k, 0]), int(runs[k, 1])
        stride = min(max(int(spacing / step_length), 1), last - k)
        center = k + stride // 2
        rx, ry = beams.mount_x - hits[center, 0], beams.mount_y - hits[center, 1]
        r = math.sqrt(rx * rx + ry * ry) + 1e-9
        if last - first >= 3:
            while True:
                mx, my, nx, ny, variance = fit_best_line(sums, center, reach, first, last, smooth)
                if variance <= rule.rough or reach <= 1:
                    break
                reach = reach // 2
            if variance > rule.rough:
                mx, my = hits[center, 0], hits[center, 1]
        else:
            mx, my, nx, ny = hits[center, 0], hits[center, 1], rx / r, ry / r
            variance = 9.0 * rule.noise * rule.noise
        alone = last - first < 3 and step_length > rule.widest
        cosine = (rx * nx + ry * ny) / r
        if cosine < 0.0:
            nx, ny, cosine = -nx, -ny, -cosine
        offset = nx * (hits[center, 0] - mx) + ny * (hits[center, 1] - my)
        blur = rule.beam_width * step_length
        oblique = blur * blur * max(1.0 - cosine * cosine, 0.0)
        floor = rule.noise * rule.noise * max(cosine * cosine, 0.04) + oblique
        if cosine > 0.05 and (rule.keeps_alone or not alone):
            out_surfaces[n_elements, 0] = hits[center, 0] - offset * nx
            out_surfaces[n_elements, 1] = hits[center, 1] - offset * ny
            out_surfaces[n_elements, 2] = 0.0 if alone else nx
            out_surfaces[n_elements, 3] = 0.0 if alone else ny
            out_surfaces[n_elements, 4] = stride / max(variance, floor)
            out_surfaces[n_elements, 5] = center
            out_surfaces[n_elements, 6] = stride
            out_surfaces[n_elements, 7] = 1.0 if FEW * step_length < rule.window else 0.0
            n_elements += 1
        k += stride
    return n_elements


@njit
def read_scan(
    points: Points,
    n: int,
    beams: Beams,
    rule: SurfaceRule,
    hits: Floats,
    runs: Floats,
    sums: Floats,
) -> None:
    """Hits, runs and sums of a scan's n end points (3, >= n), for `fit_surfaces`. ours."""
    hits_of(points, n, beams, hits)
    find_runs(hits, n, beams, rule, runs)
    sum_moments(hits, n, sums)
