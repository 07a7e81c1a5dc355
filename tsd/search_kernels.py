"""The wide start: exhaustive search over a window of poses on the coarse field."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.jit import njit
from slams.types import Floats
from tsd.field_kernels import Field, cell_value, facing


class SearchRule(NamedTuple):
    """Half widths of the window [m, rad], steps [m, rad], truncation of the field searched [m]."""

    translation: float
    rotation: float
    step: float
    angle_step: float
    truncation: float


@njit(inner=True)
def score_shift(
    field: Field, turned: Floats, count: int, x: float, y: float, rule: SearchRule
) -> float:
    """How well elements, turned already, agree with the coarse field at a position. ours: R2."""
    score = 0.0
    for k in range(count):
        ix = math.floor((x + turned[k, 0] - field.corner[0]) / field.cell)
        iy = math.floor((y + turned[k, 1] - field.corner[1]) / field.cell)
        v = cell_value(field, int(turned[k, 2]), iy, ix)
        if v == v:
            score += turned[k, 3] * max(1.0 - abs(v) / rule.truncation, 0.0)
    return score


@njit
def search(
    field: Field,
    surfaces: Floats,
    count: int,
    center: Floats,
    rule: SearchRule,
    turned: Floats,
    out_best: Floats,
) -> int:
    """The best position of every angle in the window; ours: R2, S5.

    out_best (n_angles, 4): score, x, y, theta. Returns the number of angles.
    """
    n_angles = 2 * math.ceil(rule.rotation / rule.angle_step) + 1
    n_steps = math.ceil(rule.translation / rule.step)
    n_angles = min(n_angles, out_best.shape[0])
    for a in range(n_angles):
        theta = center[2] + (a - n_angles // 2) * rule.angle_step
        c, s = math.cos(theta), math.sin(theta)
        for k in range(count):
            turned[k, 0] = c * surfaces[k, 0] - s * surfaces[k, 1]
            turned[k, 1] = s * surfaces[k, 0] + c * surfaces[k, 1]
            nx = c * surfaces[k, 2] - s * surfaces[k, 3]
            ny = s * surfaces[k, 2] + c * surfaces[k, 3]
            turned[k, 2] = facing(nx, ny)
            turned[k, 3] = 1.0
        out_best[a, 0] = -1.0
        for j in range(-n_steps, n_steps + 1):
            for i in range(-n_steps, n_steps + 1):
                x, y = center[0] + i * rule.step, center[1] + j * rule.step
                score = score_shift(field, turned, count, x, y, rule)
                if score > out_best[a, 0]:
                    out_best[a, 0] = score
                    out_best[a, 1] = x
                    out_best[a, 2] = y
                    out_best[a, 3] = theta
    return int(n_angles)
