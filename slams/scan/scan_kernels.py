"""Kernels of the scan: end points, freed from the motion of a sweep, and their normals."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats, Pose2, Ranges

Points = NDArray[np.float64]

DENSE = 8  # part of half a window that a normal may be beside its beam
BESIDE, COMPANY = 4, 2  # end points to either side; so many of them make a surface with one
POST = 0.15  # m, width of the thinnest thing that is worth a beam


class Limits(NamedTuple):
    """Which end points are used: least and greatest distance [m]."""

    near: float
    far: float


class ScanResolution(NamedTuple):
    """How fine a scan is: noise of its ranges, half window of a normal, slack of a surface [m]."""

    noise: float
    window: float
    slack: float


class Twist(NamedTuple):
    """Motion of the base during a sweep: velocity vx, vy [m/s], turn [rad/s], s per beam.

    `still` is the number of the beam at whose time the base is where end points are measured from.
    """

    vx: float
    vy: float
    turn: float
    time_increment: float
    still: float


@njit
def end_points(
    ranges: Ranges, directions: Floats, mount: Pose2, limits: Limits, out: Points
) -> tuple[int, float]:
    """End points in the base frame and the beams they are of; how many, and the farthest [m].

    [Kohlbrecher11] sec. IV-A. ranges (b,) m, directions
    (b, 2) in the laser frame, out (3, b): x, y [m], number of the beam.
    """
    c, s = math.cos(mount.theta), math.sin(mount.theta)
    n, far = 0, 0.0
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if not (limits.near < r < limits.far):
            continue
        x, y = r * directions[i, 0], r * directions[i, 1]
        x, y = mount.x + c * x - s * y, mount.y + s * x + c * y
        out[0, n] = x
        out[1, n] = y
        out[2, n] = i
        square = x * x + y * y
        far = square if square > far else far
        n += 1
    return n, math.sqrt(far)


@njit
def deskew(points: Points, n: int, twist: Twist) -> None:
    """Bring end points to the base frame at the time of the beam `still`, in place.

    ours: the original ignores that the robot moves during a sweep. points (3, >= n) of
    `end_points`; the base moves on an arc, its chord turned by half the turn.
    """
    for i in range(n):
        t = (points[2, i] - twist.still) * twist.time_increment
        turn = twist.turn * t
        c, s = math.cos(turn), math.sin(turn)
        ch, sh = math.cos(0.5 * turn), math.sin(0.5 * turn)
        x, y, vx, vy = points[0, i], points[1, i], twist.vx * t, twist.vy * t
        points[0, i] = c * x - s * y + ch * vx - sh * vy
        points[1, i] = s * x + c * y + sh * vx + ch * vy


@njit(inner=True, borrows=True)
def beyond_chord(points: Points, a: int, i: int, b: int, mount: Pose2) -> float:
    """How far end point i lies behind the line through a and b, along its beam [m]; inf: never met.

    ours: exactly 0 on a straight wall, however far apart the beams and however flat they meet it.
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
def square_gap(points: Points, i: int, k: int) -> float:
    """Squared distance of two end points [m^2]. ours."""
    dx, dy = points[0, i] - points[0, k], points[1, i] - points[1, k]
    square: float = dx * dx + dy * dy
    return square


@njit(inner=True, borrows=True)
def jumps(points: Points, i: int, mount: Pose2, step: float, slack: float) -> bool:
    """Whether a surface ends before end point i: a gap of more than `slack` [m] and four spacings.

    ours: beams are `step` [rad] apart.
    """
    square = square_gap(points, i, i - 1)
    if square <= slack * slack:  # most: no root for them
        return False
    rx, ry = points[0, i] - mount.x, points[1, i] - mount.y
    gap = slack + 4.0 * step * math.sqrt(rx * rx + ry * ry)
    return bool(square > gap * gap)


@njit
def beyond_chords(
    points: Points, n: int, mount: Pose2, near: float, most: float, out: Floats
) -> int:
    """How far beams lie off the line through both neighbors [m], out (>= n,); returns how many.

    ours: what is left of a wall there is noise. Of every third beam whose neighbors are within
    `near` [m] of each other, if it is within `most` [m]: farther off is another thing, or smoke.
    """
    count = 0
    for i in range(1, n - 1, 3):
        if square_gap(points, i - 1, i + 1) < near * near:
            off = abs(beyond_chord(points, i - 1, i, i + 1, mount))
            if off < most:
                out[count] = off
                count += 1
    return count


@njit
def remove_isolated(
    points: Points, n: int, mount: Pose2, step: float, slack: float, out: Points
) -> int:
    """Leave out end points that have no company, in place; how many are left. `out` is room.

    ours: rain, smoke, mixed pixels and faults are one beam each, a surface is several. Company are
    `COMPANY` of the `BESIDE` end points to either side, within `slack` [m] and four times the
    spacing of these beams: in smoke one is there by chance. Where a post is seen by fewer beams
    than that takes, all stay. points, out (3, >= n).
    """
    lone, before = 0, False
    for i in range(n):
        behind = i + 1 < n and square_gap(points, i, i + 1) < slack * slack
        company = before and behind  # most: no root for them
        before = behind
        if company:
            continue
        first, end = max(i - BESIDE, 0), min(i + BESIDE + 1, n)
        rx, ry = points[0, i] - mount.x, points[1, i] - mount.y
        beams = (points[2, end - 1] - points[2, first]) / max(end - 1 - first, 1)
        spacing = beams * step * math.sqrt(rx * rx + ry * ry)
        if (COMPANY + 1) * spacing >= POST:
            continue
        gap = slack + 4.0 * spacing
        near = 0
        for k in range(first, end):
            near += k != i and square_gap(points, i, k) < gap * gap
        if near < COMPANY:
            out[0, lone] = i
            lone += 1
    kept = int(out[0, 0]) if lone > 0 else n
    for k in range(lone):
        first, end = int(out[0, k]) + 1, int(out[0, k + 1]) if k + 1 < lone else n
        for i in range(first, end):
            for row in range(3):
                points[row, kept] = points[row, i]
            kept += 1
    return kept


@njit
def scan_moments(
    points: Points, n: int, mount: Pose2, step: float, slack: float, out: Floats
) -> None:
    """Running sums of x, y, xx, xy, yy along the scan, and where its surface begins anew.

    ours: a window's line comes from differences of these. `slack` [m] and `step` [rad] as of
    `jumps`; out (6, n + 1), row 5 the first index of the run of beams without a jump.
    """
    for k in range(6):
        out[k, 0] = 0.0
    first = 0
    sx = sy = sxx = sxy = syy = 0.0
    for i in range(n):
        x, y = points[0, i], points[1, i]
        if i > 0 and jumps(points, i, mount, step, slack):
            first = i
        sx, sy, sxx, sxy, syy = sx + x, sy + y, sxx + x * x, sxy + x * y, syy + y * y
        k = i + 1
        out[0, k], out[1, k], out[2, k], out[3, k], out[4, k] = sx, sy, sxx, sxy, syy
        out[5, i] = first
    out[5, n] = n


@njit(inner=True, borrows=True)
def window_normal(
    points: Points, moments: Floats, a: int, b: int, rx: float, ry: float, blur: float
) -> tuple[float, float, float]:
    """Normal of the end points a to b against the beam rx, ry [m], and their mean gap [m].

    ours: total least squares; 0, 0, 0 where there are too few of them, and where they are bent by
    more than noise of the variance `blur` [m^2].
    """
    m = b - a + 1
    if m < 3:
        return 0.0, 0.0, 0.0
    sx, sy = moments[0, b + 1] - moments[0, a], moments[1, b + 1] - moments[1, a]
    cxx = moments[2, b + 1] - moments[2, a] - sx * sx / m
    cxy = moments[3, b + 1] - moments[3, a] - sx * sy / m
    cyy = moments[4, b + 1] - moments[4, a] - sy * sy / m
    split = math.sqrt(0.25 * (cxx - cyy) * (cxx - cyy) + cxy * cxy)
    mean = 0.5 * (cxx + cyy)
    if mean - split - m * blur > 0.1 * (mean + split):
        return 0.0, 0.0, 0.0
    nx, ny = (cxy, mean - split - cxx) if cyy < cxx else (mean - split - cyy, cxy)
    length = math.sqrt(nx * nx + ny * ny)
    if not length > 0.0:
        return 0.0, 0.0, 0.0
    if nx * rx + ny * ry > 0.0:
        length = -length
    dx, dy = points[0, b] - points[0, a], points[1, b] - points[1, a]
    return nx / length, ny / length, math.sqrt(dx * dx + dy * dy) / (m - 1)


@njit
def scan_normals(
    points: Points,
    n: int,
    mount: Pose2,
    step: float,
    grain: ScanResolution,
    moments: Floats,
    out: Points,
) -> None:
    """Normal of the scan at each end point, toward the sensor, and the gap to its neighbors.

    ours: total least squares over the beams within about `grain.window`, two at least, up to the
    next jump; places bent by more than the noise (a corner in the window) get no normal. Beams
    within a `DENSE`-th of half a window that is whole have the normal of one of them. points
    (2, >= n), moments of `scan_moments`, out (3, >= n): normal (0, 0 where none), mean gap [m].
    """
    window, blur = grain.window, grain.noise * grain.noise
    last, shares = n - 1, 0
    for i in range(n - 1, -1, -1):
        if i + 1 < n and moments[5, i] != moments[5, i + 1]:
            last, shares = i, 0
        if shares > 0:
            out[0, i], out[1, i], out[2, i] = out[0, i + 1], out[1, i + 1], out[2, i + 1]
            shares -= 1
            continue
        rx, ry = points[0, i] - mount.x, points[1, i] - mount.y
        half = 2 + int(window / (step * math.sqrt(rx * rx + ry * ry) + 1e-6))
        first = int(moments[5, i])
        a = first if first > i - half else i - half
        b = last if last < i + half else i + half
        nx, ny, gap = window_normal(points, moments, a, b, rx, ry, blur)
        out[0, i], out[1, i], out[2, i] = nx, ny, gap
        shares = half // DENSE if b - a == 2 * half else 0


@njit
def chords(
    points: Points, n: int, mount: Pose2, step: float, grain: ScanResolution, out: Points
) -> None:
    """Which way the surface at each end point faces, toward the sensor; 0, 0 where it has none.

    ours: across the chord of the beams that `scan_normals` fits a line to, and as long, in a fifth
    of the time: enough to tell faces apart. points (2, >= n), out (3, >= n): a vector of any
    length, mean gap of the beams [m].
    """
    first, across = 0, grain.window / step
    while first < n:
        last = first
        while last + 1 < n and not jumps(points, last + 1, mount, step, grain.slack):
            last += 1
        for i in range(first, last + 1):
            rx, ry = points[0, i] - mount.x, points[1, i] - mount.y
            half = 2 + int(across / math.sqrt(rx * rx + ry * ry + 1e-6))
            a = first if first > i - half else i - half
            b = last if last < i + half else i + half
            nx, ny = points[1, a] - points[1, b], points[0, b] - points[0, a]
            side = 0.0 if b - a < 2 else -1.0 if nx * rx + ny * ry > 0.0 else 1.0
            out[0, i], out[1, i] = side * nx, side * ny
            out[2, i] = math.sqrt(nx * nx + ny * ny) / max(b - a, 1)
        first = last + 1
