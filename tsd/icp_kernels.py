"""ICP: surface elements of the scan to the model scan, point to line."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.geometry import add_prior, solve3, wrap_angle
from slams.jit import FAST, njit
from slams.types import Floats, Pose2
from tsd.model_kernels import Model, ray_at

MIN_PAIR_COSINE = 0.7  # between the normals of a pair
GATE_PER_RMS = 3.0  # of the pair distances; pairs farther apart are left out (trimmed ICP)


class IcpRule(NamedTuple):
    """Iterations, steps [m, rad] below which to stop, and which pairs are used.

    First and least gate on the distance of a pair [m], rays to search on either side, error of the
    map [m]. Every `stride`-th element is paired, with `stride` times its weight.
    """

    iterations: int
    stop_translation: float
    stop_rotation: float
    max_gate: float
    min_gate: float
    window: int
    map_noise: float
    stride: int


@njit(fastmath=FAST, inner=True)
def find_pair(model: Model, x: float, y: float, nx: float, ny: float, window: int) -> int:
    """Index of the nearest model point with a similar normal on the rays near a point, or -1.

    ours: projective association instead of the nearest of all points (original code).
    """
    fan = model.fan
    ray = ray_at(fan, math.atan2(y - model.y, x - model.x) - model.heading)
    found, nearest = -1, math.inf
    for j in range(ray - window, ray + window + 1):
        k = j % fan.per_circle if fan.per_circle > 0 else j
        if k < 0 or k >= fan.rays or model.points[k, 4] <= 0.0:
            continue
        dx, dy = x - model.points[k, 0], y - model.points[k, 1]
        d2 = dx * dx + dy * dy
        if d2 < nearest and nx * model.points[k, 2] + ny * model.points[k, 3] > MIN_PAIR_COSINE:
            found, nearest = k, d2
    return found


@njit(inner=True)
def sum_pairs(
    model: Model,
    surfaces: Floats,
    count: int,
    pose: Floats,
    rule: IcpRule,
    gate: float,
    out_H: Floats,
) -> tuple[float, float]:
    """Normal equations of sum w (n (T p - m))^2 over all pairs within the gate [m].

    Original code: point to point; ours: point to line on the model's normals, weighted by the
    information of the element, less near the gate. out_H (4, 3): the equations and, in the last
    row, their right side. Returns the number of pairs and the rms of their distances [m].
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for i in range(4):
        for j in range(3):
            out_H[i, j] = 0.0
    pairs, squares, floor = 0.0, 0.0, rule.map_noise * rule.map_noise
    for k in range(rule.stride // 2, count, rule.stride):
        rx = c * surfaces[k, 0] - s * surfaces[k, 1]
        ry = s * surfaces[k, 0] + c * surfaces[k, 1]
        nx = c * surfaces[k, 2] - s * surfaces[k, 3]
        ny = s * surfaces[k, 2] + c * surfaces[k, 3]
        x, y = pose[0] + rx, pose[1] + ry
        m = find_pair(model, x, y, nx, ny, rule.window)
        if m < 0:
            continue
        nx, ny = model.points[m, 2], model.points[m, 3]
        dx, dy = x - model.points[m, 0], y - model.points[m, 1]
        residual, lateral = nx * dx + ny * dy, abs(nx * dy - ny * dx)
        # model points are sparse at long range, even more so on a wall at grazing incidence
        front = abs(nx * (x - model.x) + ny * (y - model.y)) + 0.1 * model.points[m, 4]
        spacing = model.fan.gap * model.points[m, 4] * model.points[m, 4] / front
        if abs(residual) >= gate or lateral >= gate + spacing:
            continue
        taper = 1.0 - residual * residual / (gate * gate)
        w = rule.stride * taper * taper / (1.0 / surfaces[k, 4] + floor)
        nt = ny * rx - nx * ry
        pairs += rule.stride
        squares += rule.stride * residual * residual
        out_H[0, 0] += w * nx * nx
        out_H[1, 0] += w * nx * ny
        out_H[1, 1] += w * ny * ny
        out_H[2, 0] += w * nx * nt
        out_H[2, 1] += w * ny * nt
        out_H[2, 2] += w * nt * nt
        out_H[3, 0] -= w * nx * residual
        out_H[3, 1] -= w * ny * residual
        out_H[3, 2] -= w * nt * residual
    out_H[0, 1], out_H[0, 2], out_H[1, 2] = out_H[1, 0], out_H[2, 0], out_H[2, 1]
    return pairs, math.sqrt(squares / max(pairs, 1.0))


@njit
def icp(
    model: Model,
    surfaces: Floats,
    count: int,
    mean: Floats,
    prior: Floats,
    rule: IcpRule,
    out_pose: Floats,
    out_H: Floats,
) -> tuple[float, float, int]:
    """ICP from the pose in out_pose (3,), which is updated; returns pairs, rms [m], iterations.

    Original code: a gate that shrinks each round; ours: the gate follows the residual, and a prior
    (mean (3,), information `prior` (3, 3)) keeps the pose along directions that the scan does not
    observe. out_H (5, 3) is scratch; its first three rows return the information of the pairs.
    """
    b, dx = out_H[3], out_H[4]
    total = np.empty((3, 3))
    gate, pairs, rms, used = rule.max_gate, 0.0, 0.0, 0
    for _ in range(rule.iterations):
        pairs, rms = sum_pairs(model, surfaces, count, out_pose, rule, gate, out_H)
        rotation = wrap_angle(mean[2] - out_pose[2])
        offset = Pose2(mean[0] - out_pose[0], mean[1] - out_pose[1], rotation)
        add_prior(out_H, prior, 1.0, offset, total, b)
        used += 1
        if pairs == 0.0 or not solve3(total, b, dx):
            break
        for i in range(3):
            out_pose[i] += dx[i]
        next_gate = min(max(GATE_PER_RMS * rms, rule.min_gate), gate)
        small = dx[0] * dx[0] + dx[1] * dx[1] < rule.stop_translation * rule.stop_translation
        if small and abs(dx[2]) < rule.stop_rotation and next_gate > 0.9 * gate:
            break
        gate = next_gate
    return pairs, rms, used
