"""ICP: surface elements of the scan to the model scan, point to line."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.geometry import add_prior, solve3, wrap_angle
from slams.jit import FAST, njit
from slams.types import Floats, Pose2
from tsd.model_kernels import Model, ray_at

ALIKE = 0.7  # cosine between the normals of a pair
TRIMMED = 3.0  # pairs farther apart than this many of the usual distances are left out


class IcpRule(NamedTuple):
    """Iterations, steps [m, rad] below which to stop, gates [m], rays to search, map's error [m].

    The gate on a pair's distance begins at `widest` and follows what is usual to `narrowest`. Of
    the elements every `stride`-th is paired, and counts for as many.
    """

    iterations: int
    stop_translation: float
    stop_rotation: float
    widest: float
    narrowest: float
    window: int
    map_noise: float
    stride: int


@njit(fastmath=FAST, inner=True)
def find_pair(model: Model, x: float, y: float, nx: float, ny: float, window: int) -> int:
    """The nearest model point that faces alike among the rays beside a point; -1 if none.

    ours: projective association in place of the original's nearest of all.
    """
    fan = model.fan
    ray = ray_at(fan, math.atan2(y - model.y, x - model.x) - model.heading)
    found, nearest = -1, math.inf
    for j in range(ray - window, ray + window + 1):
        k = j % fan.around if fan.around > 0 else j
        if k < 0 or k >= fan.rays or model.points[k, 4] <= 0.0:
            continue
        dx, dy = x - model.points[k, 0], y - model.points[k, 1]
        d2 = dx * dx + dy * dy
        if d2 < nearest and nx * model.points[k, 2] + ny * model.points[k, 3] > ALIKE:
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
    """Normal equations of sum w (n (T p - m))^2 over all pairs within the gate.

    Original code: point to point; ours: point to line on the model's normals, weighed by what
    an element knows, less near the gate (trimmed). out_H, four rows (n, 3): the equations and
    their right side. Returns how many pairs there are and the rms of their distances [m].
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
        off, beside = nx * dx + ny * dy, abs(nx * dy - ny * dx)
        # model points far off stand far apart, the more so along a wall that is seen from the side
        front = abs(nx * (x - model.x) + ny * (y - model.y)) + 0.1 * model.points[m, 4]
        apart = model.fan.gap * model.points[m, 4] * model.points[m, 4] / front
        if abs(off) >= gate or beside >= gate + apart:
            continue
        share = 1.0 - off * off / (gate * gate)
        w = rule.stride * share * share / (1.0 / surfaces[k, 4] + floor)
        nt = ny * rx - nx * ry
        pairs += rule.stride
        squares += rule.stride * off * off
        out_H[0, 0] += w * nx * nx
        out_H[1, 0] += w * nx * ny
        out_H[1, 1] += w * ny * ny
        out_H[2, 0] += w * nx * nt
        out_H[2, 1] += w * ny * nt
        out_H[2, 2] += w * nt * nt
        out_H[3, 0] -= w * nx * off
        out_H[3, 1] -= w * ny * off
        out_H[3, 2] -= w * nt * off
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
    """ICP from out_pose (3,), which it moves. Returns pairs, rms [m], iterations.

    Original code: gate that shrinks; ours: it follows the residual, and what is known
    beforehand, a pose `mean` (3,) with information `prior` (3, 3), holds what the scan does not
    see. out_H (5, 3) is room to work; its first three rows are left as what the pairs know.
    """
    b, dx = out_H[3], out_H[4]
    total = np.empty((3, 3))
    gate, pairs, rms, used = rule.widest, 0.0, 0.0, 0
    for _ in range(rule.iterations):
        pairs, rms = sum_pairs(model, surfaces, count, out_pose, rule, gate, out_H)
        turn = wrap_angle(mean[2] - out_pose[2])
        off = Pose2(mean[0] - out_pose[0], mean[1] - out_pose[1], turn)
        add_prior(out_H, prior, 1.0, off, total, b)
        used += 1
        if pairs == 0.0 or not solve3(total, b, dx):
            break
        for i in range(3):
            out_pose[i] += dx[i]
        tighter = min(max(TRIMMED * rms, rule.narrowest), gate)
        small = dx[0] * dx[0] + dx[1] * dx[1] < rule.stop_translation * rule.stop_translation
        if small and abs(dx[2]) < rule.stop_rotation and tighter > 0.9 * gate:
            break
        gate = tighter
    return pairs, rms, used
