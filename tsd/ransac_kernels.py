"""Starts from elsewhere: random pairs of surface elements, scored by the field."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import FAST, njit
from slams.types import Floats
from tsd.map_kernels import INSIDE, PASSED, SHIFT, Field, facing

Ints = NDArray[np.int64]
AGAINST = 0.5  # what an element costs that the field contradicts


class PairRule(NamedTuple):
    """Farthest from the start [m], cosine of the largest turn, truncation of the field [m]."""

    distance: float
    least_cosine: float
    truncation: float


@njit(fastmath=FAST, inner=True)
def score_pose(
    field: Field, surfaces: Floats, count: int, pose: Floats, rule: PairRule, best: float
) -> float:
    """How well elements agree with the field at a pose; stops when it cannot beat `best`.

    Original code: the score of mode "tsd" is a product over the points; ours: a sum, which
    forgives new surfaces, less what stands where beams passed. A cell's distance is carried to the
    point along the element's normal.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    total = 0.0
    for k in range(count):
        nx = c * surfaces[k, 2] - s * surfaces[k, 3]
        ny = s * surfaces[k, 2] + c * surfaces[k, 3]
        u = (pose[0] + c * surfaces[k, 0] - s * surfaces[k, 1] - field.corner[0]) / field.cell
        v = (pose[1] + s * surfaces[k, 0] + c * surfaces[k, 1] - field.corner[1]) / field.cell
        ix, iy = math.floor(u), math.floor(v)
        ty, tx = iy >> SHIFT, ix >> SHIFT
        if 0 <= ty < field.slots.shape[0] and 0 <= tx < field.slots.shape[1]:
            slot = field.slots[ty, tx, facing(nx, ny)]
            sd = field.tsd[slot, iy & INSIDE, ix & INSIDE]
            sd += field.cell * (nx * (u - ix - 0.5) + ny * (v - iy - 0.5))
            if abs(sd) < rule.truncation:
                total += 1.0 - abs(sd) / rule.truncation
            elif sd == sd or field.seen[iy, ix] & PASSED:
                total -= AGAINST
        if total + (count - 1 - k) <= best:
            break
    return total


@njit
def try_pairs(
    field: Field,
    lines: Floats,
    trials: Ints,
    surfaces: Floats,
    count: int,
    start: Floats,
    rule: PairRule,
    out_best: Floats,
) -> None:
    """The best pose that lays a surface element on one of the lines tried, or the start.

    Original code: RANSAC of oriented points, one pair is a full hypothesis; ours: within limits
    about the start, as the original searches all of its map and finds another room. lines (n, 7) as
    made by `place_lines`; out_best (2, 4): x, y, theta, score; its last row is room to work.
    """
    pose, best = out_best[1], score_pose(field, surfaces, count, start, rule, -math.inf)
    c0, s0 = math.cos(start[2]), math.sin(start[2])
    for i in range(3):
        out_best[0, i] = start[i]
    for t in range(trials.shape[0]):
        m = trials[t]
        x, y, nx, ny = lines[m, 0], lines[m, 1], lines[m, 2], lines[m, 3]
        for k in range(count):
            mx = c0 * surfaces[k, 2] - s0 * surfaces[k, 3]
            my = s0 * surfaces[k, 2] + c0 * surfaces[k, 3]
            if mx * nx + my * ny < rule.least_cosine:
                continue
            pose[2] = start[2] + math.atan2(mx * ny - my * nx, mx * nx + my * ny)
            c, s = math.cos(pose[2]), math.sin(pose[2])
            pose[0] = x - c * surfaces[k, 0] + s * surfaces[k, 1]
            pose[1] = y - s * surfaces[k, 0] - c * surfaces[k, 1]
            if math.hypot(pose[0] - start[0], pose[1] - start[1]) > rule.distance:
                continue
            score = score_pose(field, surfaces, count, pose, rule, best)
            if score > best:
                best = score
                for i in range(3):
                    out_best[0, i] = pose[i]
    out_best[0, 3] = best
