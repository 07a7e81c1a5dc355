"""Gauss-Newton alignment of surface elements with the directional field, without pairs."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.geometry import add_prior, solve3, wrap_angle
from slams.jit import njit
from slams.types import Floats, Pose2
from tsd.map_kernels import PASS_BITS, Field, layer_of, read_field, second_layer_of, state_at

MIN_FIELD_GRADIENT = 0.3  # of the field, to replace the normal of an element
MIN_GRADIENT_COSINE = 0.85  # of gradient and normal (32 degrees); less where two lines meet
SETTLED_STEP_RATIO = 0.1  # of the robust scale; after a longer step the scale is not reduced
SCALE_PER_RESIDUAL = 2.0  # robust scale per rms residual while the scale is reduced


class MatchRule(NamedTuple):
    """Iterations, steps [m, rad] below which to stop, robust scale [m], error of the map [m]."""

    iterations: int
    stop_translation: float
    stop_rotation: float
    robust: float
    map_noise: float


@njit(inner=True)
def accumulate(
    field: Field,
    surfaces: Floats,
    count: int,
    pose: Floats,
    rule: MatchRule,
    robust: float,
    out_H: Floats,
    out_b: Floats,
) -> tuple[float, float, float]:
    """Normal equations of sum w rho(sd(T p)) over the elements in observed cells.

    ours: the residual is the field value [m], the Jacobian uses the field's gradient: the noise of
    an element's normal adds false information along a corridor. The gradient is wrong where values
    of two lines meet, so elements with a reliable, different normal are left out. Returns the
    number of elements in observed cells, the inliers (sum of robust weights), the rms residual [m].
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    n_observed, inliers, squares = 0.0, 0.0, 0.0
    scale = 1.0 / (robust * robust)
    final_scale = 1.0 / (rule.robust * rule.robust)
    xx, xy, yy, xt, yt, tt, bx, by, bt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    floor = rule.map_noise * rule.map_noise
    for k in range(count):
        rx = c * surfaces[k, 0] - s * surfaces[k, 1]
        ry = s * surfaces[k, 0] + c * surfaces[k, 1]
        nx = c * surfaces[k, 2] - s * surfaces[k, 3]
        ny = s * surfaces[k, 2] + c * surfaces[k, 3]
        v, gx, gy = read_field(field, layer_of(nx, ny), pose[0] + rx, pose[1] + ry)
        if v != v:
            continue
        slope = math.sqrt(gx * gx + gy * gy)
        consistent = True
        if slope > MIN_FIELD_GRADIENT:
            consistent = surfaces[k, 7] == 0.0 or nx * gx + ny * gy > MIN_GRADIENT_COSINE * slope
            nx, ny = gx / slope, gy / slope
        w = 1.0 / (1.0 / surfaces[k, 4] + floor)
        robust_weight = 1.0 / (1.0 + v * v * scale)
        n_observed += 1.0
        squares += v * v
        inliers += 1.0 / (1.0 + v * v * final_scale)
        if not consistent:
            continue
        w *= robust_weight * robust_weight
        nt = ny * rx - nx * ry
        xx, xy, yy = xx + w * nx * nx, xy + w * nx * ny, yy + w * ny * ny
        xt, yt, tt = xt + w * nx * nt, yt + w * ny * nt, tt + w * nt * nt
        bx, by, bt = bx - w * nx * v, by - w * ny * v, bt - w * nt * v
    out_H[0, 0], out_H[1, 0], out_H[1, 1] = xx, xy, yy
    out_H[2, 0], out_H[2, 1], out_H[2, 2] = xt, yt, tt
    out_H[0, 1], out_H[0, 2], out_H[1, 2] = xy, xt, yt
    out_b[0], out_b[1], out_b[2] = bx, by, bt
    return n_observed, inliers, math.sqrt(squares / max(n_observed, 1.0))


@njit
def align(
    field: Field,
    surfaces: Floats,
    count: int,
    mean: Floats,
    prior: Floats,
    rule: MatchRule,
    out_pose: Floats,
    out_H: Floats,
) -> tuple[float, float, float, int]:
    """Gauss-Newton from the pose in out_pose (3,), which is updated.

    ours: without a ray cast. A prior, `mean` (3,) with information `prior` (3, 3) [1/m2,
    1/(m rad), 1/rad2], keeps the pose along directions that the scan does not observe. out_H (5, 3)
    is scratch; rows 0 to 2 return the information without the prior. Returns the results of
    `accumulate` and the number of iterations.
    """
    b, dx = out_H[3], out_H[4]
    n_observed, inliers, residual = 0.0, 0.0, 0.0
    used = 0
    total = np.empty((3, 3))
    robust = 3.0 * rule.robust
    for _ in range(rule.iterations):
        n_observed, inliers, residual = accumulate(
            field, surfaces, count, out_pose, rule, robust, out_H, b
        )
        next_robust = min(max(SCALE_PER_RESIDUAL * residual, rule.robust), robust)
        rotation = wrap_angle(mean[2] - out_pose[2])
        offset = Pose2(mean[0] - out_pose[0], mean[1] - out_pose[1], rotation)
        add_prior(out_H, prior, 1.0, offset, total, b)
        used += 1
        if not solve3(total, b, dx):
            break
        out_pose[0] += dx[0]
        out_pose[1] += dx[1]
        out_pose[2] += dx[2]
        small = dx[0] * dx[0] + dx[1] * dx[1] < rule.stop_translation * rule.stop_translation
        if small and abs(dx[2]) < rule.stop_rotation and next_robust > 0.9 * robust:
            break
        limit = SETTLED_STEP_RATIO * SETTLED_STEP_RATIO * robust * robust
        if dx[0] * dx[0] + dx[1] * dx[1] < limit:
            robust = next_robust
    return n_observed, inliers, residual, used


@njit
def evaluate(
    field: Field, surfaces: Floats, count: int, pose: Floats, softness: float
) -> tuple[float, float]:
    """Inliers (sum of robust weights) and number of conflicts of a scan's elements at a pose.

    ours: an inlier is an element near a zero of the field, with weight 1/2 at `softness` [m]. A
    conflict is an element in a cell that three beams passed and that has never been near or behind
    a surface. Elements in unobserved cells are neither.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    inliers, conflicts = 0.0, 0.0
    scale = 1.0 / (softness * softness)
    for k in range(count):
        nx = c * surfaces[k, 2] - s * surfaces[k, 3]
        ny = s * surfaces[k, 2] + c * surfaces[k, 3]
        x = pose[0] + c * surfaces[k, 0] - s * surfaces[k, 1]
        y = pose[1] + s * surfaces[k, 0] + c * surfaces[k, 1]
        v, _, _ = read_field(field, layer_of(nx, ny), x, y)
        if v != v:  # the normal of a rough surface may belong to another layer
            v, _, _ = read_field(field, second_layer_of(nx, ny), x, y)
        if v == v:
            inliers += 1.0 / (1.0 + v * v * scale)
        elif state_at(field, x, y) == PASS_BITS:
            conflicts += 1.0
    return inliers, conflicts
