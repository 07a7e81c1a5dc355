"""Kernels of the lines in the cells: distances to them, Gauss-Newton on those, what they say.

ours: the last step, exact to below a cell.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from slams.geometry import add_prior, offset, solve3, wrap_angle
from slams.jit import FAST, njit
from slams.refine.line_cell_kernels import Surface
from slams.scan.scan_kernels import Points
from slams.types import Floats, Pose2

ALIKE = 0.5  # least cosine between the normals of a hit and its line


class View(NamedTuple):
    """End points of a scan and which way surfaces face there (2, >= n), and where the laser is.

    All in the base frame; `facing` has any length, 0 where nothing is known.
    """

    points: Points
    facing: Points
    n: int
    mount: Pose2


class Fit(NamedTuple):
    """How a scan is fitted to the lines.

    At most `steps` steps (0: the start is only looked at), done below `tolerance` [m] and [rad]
    times 1 m, on every `stride`-th beam until a step is below `near`, then on all; `softness` [m]
    is the residual whose weight is halved; `variance` [m^2] that of a beam, which weighs the prior.
    """

    steps: int
    tolerance: float
    near: float
    stride: int
    softness: float
    variance: float


@njit(inner=True, borrows=True)
def facing_line(
    surface: Surface, x: float, y: float, sensor_x: float, sensor_y: float
) -> tuple[float, float, float, float]:
    """Distance [m], normal and trust of the line that a beam from the sensor to (x, y) meets.

    ours: of the lines in the end point's cell that face the sensor the nearer one; trust 0: none.
    """
    height, width = surface.slot.shape
    scale = 1.0 / surface.resolution
    fx, fy = (x - surface.x0) * scale + 0.5, (y - surface.y0) * scale + 0.5
    row = np.uint64(0)  # has no line
    if fx >= 0.0 and fy >= 0.0 and fx < width and fy < height:
        row = np.uint64(surface.slot[np.uint64(fy), np.uint64(fx)])
    nx, ny, d = surface.lines[row, 0], surface.lines[row, 1], surface.lines[row, 2]
    e = nx * x + ny * y - d
    w = surface.lines[row, 3] if nx * sensor_x + ny * sensor_y > d else 0.0
    trust = surface.lines[row, 7]
    if trust > 0.0:
        mx, my, d = surface.lines[row, 4], surface.lines[row, 5], surface.lines[row, 6]
        other = mx * x + my * y - d
        if mx * sensor_x + my * sensor_y > d and (w == 0.0 or abs(other) < abs(e)):
            e, nx, ny, w = other, mx, my, trust
    return e, nx, ny, w


@njit(fastmath=FAST, inner=True, borrows=True)  # 1.4 times as fast: sums may be regrouped
def line_equations(
    surface: Surface,
    view: View,
    stride: int,
    pose: Pose2,
    soft: float,
    H: Floats,
    b: Floats,
) -> tuple[float, float, float]:
    """One linearization of the distances to the lines, [Kohlbrecher11] eq. 8-13 with these as r.

    ours: trust / (1 + soft e^2) of the line that is met is its weight; every `stride`-th beam is
    used. Returns the sums of weights, of weighted squares [m^2] and of weights without the trust:
    how many points lie on a line.
    """
    points, facing, n, mount = view
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    sx, sy = pose.x + c * mount.x - s * mount.y, pose.y + s * mount.x + c * mount.y
    hxx = hxy = hyy = hxt = hyt = htt = bx = by = bt = total = squares = near = 0.0
    for k in range((n + stride - 1) // stride):
        i = k * stride
        px, py = points[0, i], points[1, i]
        qx, qy = c * px - s * py, s * px + c * py
        e, nx, ny, w = facing_line(surface, pose.x + qx, pose.y + qy, sx, sy)
        if w == 0.0:
            continue
        ax, ay = facing[0, i], facing[1, i]
        alike = (c * ax - s * ay) * nx + (s * ax + c * ay) * ny
        if alike < 0.0 or alike * alike < ALIKE * ALIKE * (ax * ax + ay * ay):
            continue
        robust = 1.0 / (1.0 + e * e * soft)
        weight = w * robust
        nt = ny * qx - nx * qy
        wx, wy, wt = weight * nx, weight * ny, weight * nt
        hxx += wx * nx
        hxy += wx * ny
        hyy += wy * ny
        hxt += wx * nt
        hyt += wy * nt
        htt += wt * nt
        bx -= wx * e
        by -= wy * e
        bt -= wt * e
        total += weight
        squares += weight * e * e
        near += robust
    H[0, 0], H[1, 1], H[2, 2] = hxx, hyy, htt
    H[0, 1] = H[1, 0] = hxy
    H[0, 2] = H[2, 0] = hxt
    H[1, 2] = H[2, 1] = hyt
    b[0], b[1], b[2] = bx, by, bt
    return total, squares, near


@njit
def fit(
    walls: Any, scan: Any, start: Any, prior: Any, how: Any, H: Floats
) -> tuple[tuple[float, float, float], float, float]:
    """Gauss-Newton on the distances to the lines from `start`; the lines' last H is left in `H`.

    ours: [Kohlbrecher11] eq. 12, with what is known without the scan, `prior`, which decides where
    no wall does. `Surface`, `View`, the start, `Prior`, `Fit` and the pose returned are plain
    tuples: those pass between Python and here in a tenth of the time. Returns the pose, the share
    of points that lie on a line (by robust weight), and the mean square distance of those [m^2].
    """
    surface = Surface(*walls)
    points, facing, n, mount = scan
    view = View(points, facing, n, Pose2(*mount))
    x, y, theta = start
    (expected_x, expected_y, expected_theta), information = prior
    expected = Pose2(expected_x, expected_y, expected_theta)
    steps, tolerance, near_enough, stride, softness, usual = how
    room = np.empty((5, 3))  # one array: each further kind costs half a second to compile
    b, step, total_H = room[3], room[4], room
    soft = 1.0 / (softness * softness)
    share = square = 0.0
    for k in range(steps + 1):
        stride = stride if k < steps - 1 else 1
        pose = Pose2(x, y, theta)
        total, squares, near = line_equations(surface, view, stride, pose, soft, H, b)
        share, square = stride * near / max(view.n, 1), squares / max(total, 1e-9)
        if k == steps:
            break
        variance = usual / stride  # so many beams are in one
        add_prior(H, information, variance, offset(pose, expected), total_H, b)
        if not solve3(total_H, b, step):
            break
        x, y, theta = x + step[0], y + step[1], theta + step[2]
        short = tolerance if stride == 1 else near_enough
        if math.hypot(step[0], step[1]) < short and abs(step[2]) < short:
            if stride == 1:
                break
            stride = 1
    return (x, y, wrap_angle(theta)), share, square


@njit
def evaluate(
    walls: Any, points: Points, n: int, stride: int, mount: Any, pose: Any, soft: float
) -> tuple[float, float]:
    """Shares of every `stride`-th end that are inliers, by robust weight, and conflicts at a pose.

    ours: an inlier is an end near a line, a conflict an end in a free cell that has no line. Ends
    where nothing is known are neither. Plain tuples as in `fit`.
    """
    surface = Surface(*walls)
    height, width = surface.slot.shape
    scale = 1.0 / surface.resolution
    (mx, my, _), (px, py, theta) = mount, pose
    c, s = math.cos(theta), math.sin(theta)
    sx, sy = px + c * mx - s * my, py + s * mx + c * my
    inliers = conflicts = 0.0
    for i in range(0, n, stride):
        x = px + c * points[0, i] - s * points[1, i]
        y = py + s * points[0, i] + c * points[1, i]
        fx, fy = (x - surface.x0) * scale + 0.5, (y - surface.y0) * scale + 0.5
        if not (fx >= 0.0 and fy >= 0.0 and fx < width and fy < height):
            continue
        u, v = np.uint64(fx), np.uint64(fy)
        if surface.slot[v, u] == 0:
            conflicts += 1.0 if surface.seen[v, u] < surface.free else 0.0
            continue
        e, _, _, w = facing_line(surface, x, y, sx, sy)
        inliers += 1.0 / (1.0 + e * e * soft) if w > 0.0 else 0.0
    used = max((n + stride - 1) // stride, 1)
    return inliers / used, conflicts / used
