"""Kernels of the match to line cells: distances, Gauss-Newton, inliers and conflicts.

ours: the last step of a match, exact to below a cell.

[Kish65] L. Kish: Survey Sampling. Wiley 1965. Design effect of observations in clusters.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from slams.geometry import add_prior, offset, solve3, wrap_angle
from slams.jit import FAST, njit
from slams.refine.line_cell_kernels import LineCells
from slams.scan.scan_kernels import Points
from slams.types import Floats, Pose2

MIN_LINE_COSINE = 0.5  # between the normals of a hit and of its line
N_CLUSTERS = 32  # of a scan; the errors of the beams in a cluster may be correlated


class View(NamedTuple):
    """End points of a scan (4, >= n), their normals (2, >= n), and the pose of the laser, `mount`.

    All in the base frame; a normal has any length, 0 where it is unknown.
    """

    points: Points
    normals: Points
    n: int
    mount: Pose2


class Fit(NamedTuple):
    """Settings of Gauss-Newton on the lines.

    `steps`: their greatest number; with 0 the start is only evaluated. A step below `tolerance` [m]
    and [rad] is the last. Every `stride`-th beam is used until a step is below
    `stride_tolerance`, then all. `softness` [m]: residual whose weight is halved. `variance` [m^2]
    of a beam, which weights the prior.
    """

    steps: int
    tolerance: float
    stride_tolerance: float
    stride: int
    softness: float
    variance: float


@njit(inner=True, borrows=True)
def facing_line(
    cells: LineCells, x: float, y: float, sensor_x: float, sensor_y: float
) -> tuple[float, float, float, float]:
    """Distance [m], normal and confidence of the line that a beam from the sensor to (x, y) hits.

    ours: the nearer line in the end point's cell that faces the sensor; confidence 0 if none does.
    """
    height, width = cells.slot.shape
    scale = 1.0 / cells.resolution
    fx, fy = (x - cells.x0) * scale + 0.5, (y - cells.y0) * scale + 0.5
    row = np.uint64(0)  # the row without a line
    if fx >= 0.0 and fy >= 0.0 and fx < width and fy < height:
        row = np.uint64(cells.slot[np.uint64(fy), np.uint64(fx)])
    nx, ny, d = cells.lines[row, 0], cells.lines[row, 1], cells.lines[row, 2]
    e = nx * x + ny * y - d
    w = cells.lines[row, 3] if nx * sensor_x + ny * sensor_y > d else 0.0
    confidence = cells.lines[row, 7]
    if confidence > 0.0:
        mx, my, d = cells.lines[row, 4], cells.lines[row, 5], cells.lines[row, 6]
        other = mx * x + my * y - d
        if mx * sensor_x + my * sensor_y > d and (w == 0.0 or abs(other) < abs(e)):
            e, nx, ny, w = other, mx, my, confidence
    return e, nx, ny, w


@njit(fastmath=FAST, inner=True, borrows=True)  # 1.4 times as fast: sums may be regrouped
def line_equations(
    cells: LineCells, view: View, stride: int, pose: Pose2, soft: float, H: Floats, b: Floats
) -> tuple[float, float, float, float]:
    """Normal equations H, b of the distances to the lines, [Kohlbrecher11] eq. 8-13.

    ours: a distance e to a line has the weight confidence p / (1 + soft p e^2), where p is that of
    its beam; every `stride`-th beam is used. Returns the sums of the weights without p, of the
    weighted squares [m^2], and of the weights by e alone: the number of inliers; and the design
    effect [Kish65], by which errors that are correlated within clusters raise the variance of a sum
    of beams, less what chance explains.
    """
    points, normals, n, mount = view
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    sx, sy = pose.x + c * mount.x - s * mount.y, pose.y + s * mount.x + c * mount.y
    hxx = hxy = hyy = hxt = hyt = htt = bx = by = bt = total = squares = inliers = 0.0
    independent = clustered = cluster = 0.0
    left = cluster_beams = max((n + N_CLUSTERS - 1) // N_CLUSTERS, 1)
    for i in range(0, n, stride):
        left -= stride
        if left < 0:
            clustered += cluster * cluster
            left += cluster_beams
            cluster = 0.0
        px, py = points[0, i], points[1, i]
        qx, qy = c * px - s * py, s * px + c * py
        e, nx, ny, w = facing_line(cells, pose.x + qx, pose.y + qy, sx, sy)
        if w == 0.0:
            continue
        ax, ay = normals[0, i], normals[1, i]
        along = (c * ax - s * ay) * nx + (s * ax + c * ay) * ny
        if along < 0.0 or along * along < MIN_LINE_COSINE * MIN_LINE_COSINE * (ax * ax + ay * ay):
            continue
        precision = points[3, i]
        robust = 1.0 / (1.0 + precision * e * e * soft)
        weight = precision * w * robust
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
        total += w * robust
        squares += weight * e * e
        inliers += robust
        cluster += weight * e
        independent += weight * weight * e * e
    H[0, 0], H[1, 1], H[2, 2] = hxx, hyy, htt
    H[0, 1] = H[1, 0] = hxy
    H[0, 2] = H[2, 0] = hxt
    H[1, 2] = H[2, 1] = hyt
    b[0], b[1], b[2] = bx, by, bt
    clustered += cluster * cluster
    chance = 2.0 * math.sqrt(2.0 / N_CLUSTERS)  # two deviations of a mean square
    effect = max(clustered / max(independent, 1e-12) - chance, 1.0)
    return total, squares, inliers, effect


@njit
def fit(
    walls: Any, scan: Any, start: Any, prior: Any, settings: Any, H: Floats
) -> tuple[tuple[float, float, float], float, float, float]:
    """Gauss-Newton on the distances to the lines from `start`; leaves the information in `H`.

    ours: [Kohlbrecher11] eq. 12 with the prediction as `prior`, which decides along a degenerate
    direction. `LineCells`, `View`, start, `Prior`, `Fit` and the pose returned are plain tuples,
    which pass between Python and here in a tenth of the time. Returns the pose, the inlier ratio by
    robust weights, the mean square distance of the inliers [m^2], and the design effect.
    """
    cells = LineCells(*walls)
    points, normals, n, mount = scan
    view = View(points, normals, n, Pose2(*mount))
    x, y, theta = start
    (expected_x, expected_y, expected_theta), information = prior
    expected = Pose2(expected_x, expected_y, expected_theta)
    steps, tolerance, stride_tolerance, stride, softness, beam_variance = settings
    scratch = np.empty((5, 3))  # one array: each further kind costs half a second to compile
    b, step, total_H = scratch[3], scratch[4], scratch
    soft = 1.0 / (softness * softness)
    inlier_ratio = mean_square = effect = 0.0
    for k in range(steps + 1):
        stride = stride if k < steps - 1 else 1
        pose = Pose2(x, y, theta)
        total, squares, inliers, effect = line_equations(cells, view, stride, pose, soft, H, b)
        inlier_ratio, mean_square = stride * inliers / max(view.n, 1), squares / max(total, 1e-9)
        if k == steps:
            break
        variance = beam_variance / stride  # a beam stands for `stride` beams
        add_prior(H, information, variance, offset(pose, expected), total_H, b)
        if not solve3(total_H, b, step):
            break
        x, y, theta = x + step[0], y + step[1], theta + step[2]
        limit = tolerance if stride == 1 else stride_tolerance
        if math.hypot(step[0], step[1]) < limit and abs(step[2]) < limit:
            if stride == 1:
                break
            stride = 1
    return (x, y, wrap_angle(theta)), inlier_ratio, mean_square, effect


@njit
def evaluate(
    walls: Any, points: Points, n: int, stride: int, mount: Any, pose: Any, soft: float
) -> tuple[float, float]:
    """Inlier ratio by robust weights and free-space conflict of a scan at a pose.

    ours: an inlier is an end point near a line, a conflict one in a free cell without a line. End
    points in unknown cells are neither. Every `stride`-th is used. Plain tuples as in `fit`.
    """
    cells = LineCells(*walls)
    height, width = cells.slot.shape
    scale = 1.0 / cells.resolution
    (mx, my, _), (px, py, theta) = mount, pose
    c, s = math.cos(theta), math.sin(theta)
    sx, sy = px + c * mx - s * my, py + s * mx + c * my
    inliers = conflicts = 0.0
    for i in range(0, n, stride):
        x = px + c * points[0, i] - s * points[1, i]
        y = py + s * points[0, i] + c * points[1, i]
        fx, fy = (x - cells.x0) * scale + 0.5, (y - cells.y0) * scale + 0.5
        if not (fx >= 0.0 and fy >= 0.0 and fx < width and fy < height):
            continue
        u, v = np.uint64(fx), np.uint64(fy)
        if cells.slot[v, u] == 0:
            conflicts += 1.0 if cells.grid[v, u] < cells.free else 0.0
            continue
        e, _, _, w = facing_line(cells, x, y, sx, sy)
        inliers += 1.0 / (1.0 + points[3, i] * e * e * soft) if w > 0.0 else 0.0
    used = max((n + stride - 1) // stride, 1)
    return inliers / used, conflicts / used
