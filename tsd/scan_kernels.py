"""From end points to surfaces: the line through each end point's neighborhood."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.jit import FAST, njit
from slams.scan.scan_kernels import Points, beyond_chord
from slams.types import Floats, Pose2

GAP, NEAR = 3.0, 0.3  # beams from hit to hit, or m, beyond which a surface ends
SMOOTH = 1.5  # variances of the noise, below which a window has no corner
IN_LINE = 4.0  # deviations of the noise along a beam
FEW = 2.0  # hits to either side in a window, below which they do not tell a normal of their own


class Beams(NamedTuple):
    """A laser as the kernels see it: where it is on the base [m], angle between beams [rad]."""

    mount_x: float
    mount_y: float
    angle_increment: float


class SurfaceRule(NamedTuple):
    """What counts as one surface.

    Half window of a line [m], range noise [m], jump angle's cotangent, variance [m2] of a rough
    one, blur across in beam spacings, widest gap [m] to the next beam at which a hit alone is a
    surface; whether one that is none is kept, without a normal.
    """

    window: float
    noise: float
    max_slope: float
    rough: float
    beam_width: float
    widest: float
    keeps_alone: bool


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


@njit(inner=True)
def in_line(points: Points, n: int, first: int, beams: Beams, noise: float) -> bool:
    """Whether three hits, of beams side by side, lie on one line up to noise.

    ours: far along a corridor hits are a meter apart, and still on one wall. Taken for a surface
    each, facing the laser, they move with the robot and hold it where it is.
    """
    if first < 0 or first + 2 >= n or points[2, first + 2] - points[2, first] > 4.0:
        return False
    mount = Pose2(beams.mount_x, beams.mount_y, 0.0)
    return abs(beyond_chord(points, first, first + 1, first + 2, mount)) < IN_LINE * noise


@njit(inner=True)
def side_by_side(points: Points, a: int, b: int, beams: Beams, rule: SurfaceRule) -> bool:
    """Whether hit a and a later one b may be of one surface, by their ranges.

    ours: the published 3 degree jump test, with room for range noise, and for grazing walls.
    """
    ra = math.hypot(points[0, a] - beams.mount_x, points[1, a] - beams.mount_y)
    rb = math.hypot(points[0, b] - beams.mount_x, points[1, b] - beams.mount_y)
    steps = points[2, b] - points[2, a]
    spacing = min(ra, rb) * abs(beams.angle_increment) * steps
    near = steps <= GAP or spacing < NEAR
    return bool(near and abs(rb - ra) <= rule.max_slope * spacing + 4.0 * rule.noise)


@njit
def find_runs(points: Points, n: int, beams: Beams, rule: SurfaceRule, out_first: Floats) -> None:
    """The first hit of the unbroken surface that every hit lies on, out_first (n + 1,). ours."""
    first = 0
    for k in range(1, n):
        if (
            not side_by_side(points, k - 1, k, beams, rule)
            and not in_line(points, n, k - 2, beams, rule.noise)
            and not in_line(points, n, k - 1, beams, rule.noise)
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
    """Surface elements every `spacing` [m]: point on the local line, normal, information.

    ours: lines through many hits are less noisy than a hit. points (3, n), sums (6, n + 1) of
    `scan_moments`, firsts (n + 1,) of `find_runs`; out_surfaces (n, 8): x, y [m], normal
    x, y (towards the laser), information [1/m2] of the beams it stands for, index of its hit, how
    many beams, 1 if hits are close enough to tell its normal. One hit alone where beams are far
    apart may lie on a wall of any direction: taken to face the laser it would move with the robot.
    It has no normal (0, 0), or is left out.
    """
    n_elements, k, last = 0, 0, 0
    smooth = SMOOTH * rule.noise * rule.noise
    while k < count:
        rx, ry = beams.mount_x - points[0, k], beams.mount_y - points[1, k]
        step_length = max(math.sqrt(rx * rx + ry * ry) * abs(beams.angle_increment), 1e-6)
        reach = max(int(rule.window / step_length), 2)
        first = int(firsts[k])
        while last <= k or (last < count and firsts[last] == first):
            last += 1
        stride = min(max(int(spacing / step_length), 1), last - k)
        center = k + stride // 2
        rx, ry = beams.mount_x - points[0, center], beams.mount_y - points[1, center]
        r = math.sqrt(rx * rx + ry * ry) + 1e-9
        alone = False
        if last - first >= 3:
            while True:
                mx, my, nx, ny, variance = fit_best_line(sums, center, reach, first, last, smooth)
                if variance <= rule.rough or reach <= 1:
                    break
                reach = reach // 2
            if variance > rule.rough:
                mx, my = points[0, center], points[1, center]
        else:
            alone = step_length > rule.widest
            mx, my, nx, ny = points[0, center], points[1, center], rx / r, ry / r
            variance = 9.0 * rule.noise * rule.noise
        cosine = (rx * nx + ry * ny) / r
        if cosine < 0.0:
            nx, ny, cosine = -nx, -ny, -cosine
        offset = nx * (points[0, center] - mx) + ny * (points[1, center] - my)
        blur = rule.beam_width * step_length
        oblique = blur * blur * max(1.0 - cosine * cosine, 0.0)
        floor = rule.noise * rule.noise * max(cosine * cosine, 0.04) + oblique
        if cosine > 0.05 and (rule.keeps_alone or not alone):
            out_surfaces[n_elements, 0] = points[0, center] - offset * nx
            out_surfaces[n_elements, 1] = points[1, center] - offset * ny
            out_surfaces[n_elements, 2] = 0.0 if alone else nx
            out_surfaces[n_elements, 3] = 0.0 if alone else ny
            out_surfaces[n_elements, 4] = stride / max(variance, floor)
            out_surfaces[n_elements, 5] = center
            out_surfaces[n_elements, 6] = stride
            out_surfaces[n_elements, 7] = 1.0 if FEW * step_length < rule.window else 0.0
            n_elements += 1
        k += stride
    return n_elements
