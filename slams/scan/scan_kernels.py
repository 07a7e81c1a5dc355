"""Kernels of the scan: end points, deskewing, isolated-point filter, normals."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats, Pose2, Ranges

Points = NDArray[np.float64]

NORMALS_PER_HALF_WINDOW = 8  # end points between two of these share a normal
N_NEIGHBORS, MIN_CLOSE_NEIGHBORS = 4, 2  # end points to either side; close ones of a surface
MAX_WEIGHT = 4.0  # of a beam: for a nearer one the error of the map outweighs its noise
MIN_OBJECT_WIDTH = 0.15  # m of an object that the isolated-point filter has to leave


class ScanResolution(NamedTuple):
    """Noise of the ranges, half window of a normal, least gap between two surfaces, all [m]."""

    noise: float
    window: float
    gap_threshold: float


@njit
def end_points(
    ranges: Ranges,
    directions: Floats,
    mount: Pose2,
    limits: tuple[float, float],
    typical: float,
    out: Points,
) -> tuple[int, float]:
    """End points out (4, b) of ranges (b,) [m] in the base frame; their number, the farthest [m].

    [Kohlbrecher11] sec. IV-A. directions (b, 2) in the laser frame; out: x, y [m], beam's number,
    weight. Ranges that are used are between the `limits` [m]. ours: a weight is the inverse
    variance relative to that at the `typical` range [m], to which the noise is proportional; it is
    1 for all if that is 0.
    """
    c, s = math.cos(mount.theta), math.sin(mount.theta)
    square_of_typical = typical * typical
    n, far = 0, 0.0
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if not (limits[0] < r < limits[1]):
            continue
        x, y = r * directions[i, 0], r * directions[i, 1]
        x, y = mount.x + c * x - s * y, mount.y + s * x + c * y
        out[0, n] = x
        out[1, n] = y
        out[2, n] = i
        out[3, n] = 1.0
        if typical > 0.0:
            is_near = square_of_typical >= MAX_WEIGHT * r * r
            out[3, n] = MAX_WEIGHT if is_near else square_of_typical / (r * r)
        square = x * x + y * y
        far = square if square > far else far
        n += 1
    return n, math.sqrt(far)


@njit
def deskew(points: Points, n: int, twist: Pose2, time_increment: float, reference: float) -> None:
    """Move end points to the base frame at the time of the beam `reference`, in place.

    ours: the original ignores that the robot moves during a sweep. points (4, >= n) of
    `end_points`; `twist` of the base [m/s, rad/s], `time_increment` [s] from beam to beam. The base
    moves on an arc, whose chord is rotated by half the arc's angle.
    """
    for i in range(n):
        t = (points[2, i] - reference) * time_increment
        angle = twist.theta * t
        c, s = math.cos(angle), math.sin(angle)
        ch, sh = math.cos(0.5 * angle), math.sin(0.5 * angle)
        x, y, vx, vy = points[0, i], points[1, i], twist.x * t, twist.y * t
        points[0, i] = c * x - s * y + ch * vx - sh * vy
        points[1, i] = s * x + c * y + sh * vx + ch * vy


@njit(inner=True, borrows=True)
def square_gap(points: Points, i: int, k: int) -> float:
    """Squared distance of two end points [m^2]. ours."""
    dx, dy = points[0, i] - points[0, k], points[1, i] - points[1, k]
    square: float = dx * dx + dy * dy
    return square


@njit(inner=True, borrows=True)
def jumps(points: Points, i: int, mount: Pose2, step: float, gap_threshold: float) -> bool:
    """Whether a surface ends before end point i; `step` [rad] is the angle between two beams.

    ours: there is a gap of more than `gap_threshold` [m] plus four spacings of the beams.
    """
    square = square_gap(points, i, i - 1)
    if square <= gap_threshold * gap_threshold:  # most end points: saves the square root
        return False
    rx, ry = points[0, i] - mount.x, points[1, i] - mount.y
    gap = gap_threshold + 4.0 * step * math.sqrt(rx * rx + ry * ry)
    return bool(square > gap * gap)


@njit
def remove_isolated(
    points: Points, n: int, mount: Pose2, step: float, gap_threshold: float, scratch: Points
) -> int:
    """Isolated-point filter, in place; returns how many end points are left.

    ours: rain, smoke, mixed pixels and faults give single end points. `MIN_CLOSE_NEIGHBORS` of the
    `N_NEIGHBORS` to either side have to be within `gap_threshold` [m] plus four spacings. Where an
    object of `MIN_OBJECT_WIDTH` has too few beams for that, all stay. points, scratch (4, >= n).
    """
    isolated, near_last = 0, False
    for i in range(n):
        near_next = i + 1 < n and square_gap(points, i, i + 1) < gap_threshold * gap_threshold
        is_between = near_last and near_next  # most end points: saves the square root
        near_last = near_next
        if is_between:
            continue
        first, end = max(i - N_NEIGHBORS, 0), min(i + N_NEIGHBORS + 1, n)
        rx, ry = points[0, i] - mount.x, points[1, i] - mount.y
        beams = (points[2, end - 1] - points[2, first]) / max(end - 1 - first, 1)
        spacing = beams * step * math.sqrt(rx * rx + ry * ry)
        if (MIN_CLOSE_NEIGHBORS + 1) * spacing >= MIN_OBJECT_WIDTH:
            continue
        gap = gap_threshold + 4.0 * spacing
        near = 0
        for k in range(first, end):
            near += k != i and square_gap(points, i, k) < gap * gap
        if near < MIN_CLOSE_NEIGHBORS:
            scratch[0, isolated] = i
            isolated += 1
    if isolated == 0:
        return n
    removed = 0
    for i in range(n):
        if removed < isolated and scratch[0, removed] == i:
            removed += 1
            continue
        for row in range(4):
            points[row, i - removed] = points[row, i]
    return n - removed


@njit
def scan_moments(
    points: Points, n: int, mount: Pose2, step: float, gap_threshold: float, out: Floats
) -> None:
    """Running sums of x, y, xx, xy, yy along the scan, and the starts of its surfaces.

    ours: the line of a window is computed from differences of the sums. `gap_threshold` [m] and
    `step` [rad] as in `jumps`; out (6, n + 1), row 5 the first end point of each one's surface.
    """
    for k in range(6):
        out[k, 0] = 0.0
    first = 0
    for i in range(n):
        x, y = points[0, i], points[1, i]
        if i > 0 and jumps(points, i, mount, step, gap_threshold):
            first = i
        terms = (x, y, x * x, x * y, y * y)
        for k in range(5):
            out[k, i + 1] = out[k, i] + terms[k]
        out[5, i] = first
    out[5, n] = n


@njit(inner=True, borrows=True)
def window_normal(
    points: Points, moments: Floats, a: int, b: int, rx: float, ry: float, variance: float
) -> tuple[float, float, float]:
    """Normal of the end points a to b, against the beam rx, ry [m], and their mean gap [m].

    ours: total least squares; 0 if they are too few, or curved by more than the `variance` [m^2].
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
    if mean - split - m * variance > 0.1 * (mean + split):
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
    resolution: ScanResolution,
    moments: Floats,
    out: Points,
) -> None:
    """Normal of the scan at each end point, toward the sensor, and the gap to its neighbors.

    ours: total least squares over the end points of one surface within about `resolution.window`,
    at least two to either side; 0, 0 at a corner. Neighbors share a normal where the window is
    complete. points (2, >= n), moments of `scan_moments`, out (3, >= n): normal, mean gap [m].
    """
    window, variance = resolution.window, resolution.noise * resolution.noise
    for i in range(n - 1, -1, -1):
        if moments[5, i] != moments[5, i + 1]:
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
        nx, ny, gap = window_normal(points, moments, a, b, rx, ry, variance)
        out[0, i], out[1, i], out[2, i] = nx, ny, gap
        shares = half // NORMALS_PER_HALF_WINDOW if b - a == 2 * half else 0


@njit
def chords(
    points: Points, n: int, mount: Pose2, step: float, resolution: ScanResolution, out: Points
) -> None:
    """Vector across the surface at each end point, toward the sensor; 0, 0 where it has none.

    ours: perpendicular to the chord of the window of `scan_normals`; it separates the faces of a
    wall, in half of the time. points (2, >= n), out (3, >= n): vector and mean gap [m].
    """
    first, across = 0, resolution.window / step
    while first < n:
        last = first
        while last + 1 < n and not jumps(points, last + 1, mount, step, resolution.gap_threshold):
            last += 1
        for i in range(first, last + 1):
            rx, ry = points[0, i] - mount.x, points[1, i] - mount.y
            half = 2 + int(across / math.sqrt(rx * rx + ry * ry + 1e-6))
            a, b = np.uint64(max(first, i - half)), np.uint64(min(last, i + half))
            nx, ny = points[1, a] - points[1, b], points[0, b] - points[0, a]
            gaps = float(b - a)
            side = 0.0 if gaps < 2.0 else -1.0 if nx * rx + ny * ry > 0.0 else 1.0
            out[0, i], out[1, i] = side * nx, side * ny
            out[2, i] = math.sqrt(nx * nx + ny * ny) / max(gaps, 1.0)
        first = last + 1
