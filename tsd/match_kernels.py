"""Direct alignment of surface elements with the directional field: Gauss-Newton."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.geometry import add_prior, solve3, wrap_angle
from slams.jit import njit
from slams.types import Floats, Pose2
from tsd.map_kernels import PASSED, Field, facing, next_facing, read_field, seen_at

FLAT = 0.3  # least slope of the field for a direction of its own
ALIKE = 0.85  # cosine between that and an element's normal, below which values of two lines meet
SETTLED = 0.1  # of the robust scale: after a longer step it stays for another
ANNEAL = 2.0  # the robust scale follows the residual down, in residuals


class MatchRule(NamedTuple):
    """Iterations, steps [m, rad] below which to stop, robust scale [m], map's own error [m]."""

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
    """Normal equations of sum w rho(sd(T p)), the sum over all elements that the field knows.

    ours: residual = field value [m], Jacobian = the field's own direction: an element's normal
    is noisy, and noise that points along a corridor holds the pose there. So does the field's own
    where values of two lines meet: an element whose normal is known from its hits, and not alike,
    says nothing. Returns how many elements are known, how many close (robustly), and the rms of the
    known residuals [m].
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    known, close, squares = 0.0, 0.0, 0.0
    scale = 1.0 / (robust * robust)
    final_scale = 1.0 / (rule.robust * rule.robust)
    xx, xy, yy, xt, yt, tt, bx, by, bt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    floor = rule.map_noise * rule.map_noise
    for k in range(count):
        rx = c * surfaces[k, 0] - s * surfaces[k, 1]
        ry = s * surfaces[k, 0] + c * surfaces[k, 1]
        nx = c * surfaces[k, 2] - s * surfaces[k, 3]
        ny = s * surfaces[k, 2] + c * surfaces[k, 3]
        v, gx, gy = read_field(field, facing(nx, ny), pose[0] + rx, pose[1] + ry)
        if v != v:
            continue
        slope = math.sqrt(gx * gx + gy * gy)
        alike = True
        if slope > FLAT:
            alike = surfaces[k, 7] == 0.0 or nx * gx + ny * gy > ALIKE * slope
            nx, ny = gx / slope, gy / slope
        w = 1.0 / (1.0 / surfaces[k, 4] + floor)
        trust = 1.0 / (1.0 + v * v * scale)
        known += 1.0
        squares += v * v
        close += 1.0 / (1.0 + v * v * final_scale)
        if not alike:
            continue
        w *= trust * trust
        nt = ny * rx - nx * ry
        xx, xy, yy = xx + w * nx * nx, xy + w * nx * ny, yy + w * ny * ny
        xt, yt, tt = xt + w * nx * nt, yt + w * ny * nt, tt + w * nt * nt
        bx, by, bt = bx - w * nx * v, by - w * ny * v, bt - w * nt * v
    out_H[0, 0], out_H[1, 0], out_H[1, 1] = xx, xy, yy
    out_H[2, 0], out_H[2, 1], out_H[2, 2] = xt, yt, tt
    out_H[0, 1], out_H[0, 2], out_H[1, 2] = xy, xt, yt
    out_b[0], out_b[1], out_b[2] = bx, by, bt
    return known, close, math.sqrt(squares / max(known, 1.0))


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
    """Gauss-Newton from out_pose (3,), which it moves.

    ours: the model is the field itself, without a ray cast. Returns known, close and residual as
    `accumulate`, and the iterations.
    prior (3, 3): information [1/m2, 1/(m rad), 1/rad2] of a pose `mean` (3,) known beforehand,
    which holds the directions that the scan does not see; out_H is left without it.
    """
    b, dx = out_H[3], out_H[4]
    known, close, residual = 0.0, 0.0, 0.0
    used = 0
    total = np.empty((3, 3))
    robust = 3.0 * rule.robust
    for _ in range(rule.iterations):
        known, close, residual = accumulate(
            field, surfaces, count, out_pose, rule, robust, out_H, b
        )
        tighter = min(max(ANNEAL * residual, rule.robust), robust)
        turn = wrap_angle(mean[2] - out_pose[2])
        off = Pose2(mean[0] - out_pose[0], mean[1] - out_pose[1], turn)
        add_prior(out_H, prior, 1.0, off, total, b)
        used += 1
        if not solve3(total, b, dx):
            break
        out_pose[0] += dx[0]
        out_pose[1] += dx[1]
        out_pose[2] += dx[2]
        small = dx[0] * dx[0] + dx[1] * dx[1] < rule.stop_translation * rule.stop_translation
        if small and abs(dx[2]) < rule.stop_rotation and tighter > 0.9 * robust:
            break
        if dx[0] * dx[0] + dx[1] * dx[1] < SETTLED * SETTLED * robust * robust:
            robust = tighter
    return known, close, residual, used


@njit
def evaluate(
    field: Field, surfaces: Floats, count: int, pose: Floats, softness: float
) -> tuple[float, float]:
    """Sum of inliers, by robust weight, and number of conflicts of a scan's elements at a pose.

    ours: an inlier is an element near zero, by `softness` [m]; a conflict is one that stands where
    three beams passed and no surface ever was. Elements where nothing is known are neither.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    inliers, conflicts = 0.0, 0.0
    scale = 1.0 / (softness * softness)
    for k in range(count):
        nx = c * surfaces[k, 2] - s * surfaces[k, 3]
        ny = s * surfaces[k, 2] + c * surfaces[k, 3]
        x = pose[0] + c * surfaces[k, 0] - s * surfaces[k, 1]
        y = pose[1] + s * surfaces[k, 0] + c * surfaces[k, 1]
        v, _, _ = read_field(field, facing(nx, ny), x, y)
        if v != v:  # rough surfaces have normals that are not those of the map
            v, _, _ = read_field(field, next_facing(nx, ny), x, y)
        if v == v:
            inliers += 1.0 / (1.0 + v * v * scale)
        elif seen_at(field, x, y) == PASSED:
            conflicts += 1.0
    return inliers, conflicts
