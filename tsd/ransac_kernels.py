"""RANSAC: poses proposed by pairs of oriented points, scored by the field."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import FAST, njit
from slams.types import Floats
from tsd.map_kernels import PASS_BITS, TSD_TILE_MASK, TSD_TILE_SHIFT, Field, layer_of

Ints = NDArray[np.int64]
CONFLICT_PENALTY = 0.5  # of an element in conflict with the field; an inlier scores up to 1


class PairRule(NamedTuple):
    """Largest distance [m] and cosine of the largest rotation from the start, truncation [m]."""

    max_distance: float
    min_cosine: float
    truncation: float


@njit(fastmath=FAST, inner=True)
def score_pose(
    field: Field, surfaces: Floats, count: int, pose: Floats, rule: PairRule, best: float
) -> float:
    """Match score of a pose: inliers less conflicts; stops when it cannot exceed `best`.

    Original code: the score of mode "tsd" is a product over the points; ours: a sum, in which new
    surfaces count zero and elements in free cells count as conflicts. The distance of a cell is
    extrapolated to the element along the element's normal.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    total = 0.0
    for k in range(count):
        nx = c * surfaces[k, 2] - s * surfaces[k, 3]
        ny = s * surfaces[k, 2] + c * surfaces[k, 3]
        u = (pose[0] + c * surfaces[k, 0] - s * surfaces[k, 1] - field.corner[0]) / field.cell
        v = (pose[1] + s * surfaces[k, 0] + c * surfaces[k, 1] - field.corner[1]) / field.cell
        ix, iy = math.floor(u), math.floor(v)
        ty, tx = iy >> TSD_TILE_SHIFT, ix >> TSD_TILE_SHIFT
        if 0 <= ty < field.slots.shape[0] and 0 <= tx < field.slots.shape[1]:
            slot = field.slots[ty, tx, layer_of(nx, ny)]
            sd = field.tsd[slot, iy & TSD_TILE_MASK, ix & TSD_TILE_MASK]
            sd += field.cell * (nx * (u - ix - 0.5) + ny * (v - iy - 0.5))
            if abs(sd) < rule.truncation:
                total += 1.0 - abs(sd) / rule.truncation
            elif sd == sd or field.cell_state[iy, ix] & PASS_BITS:
                total -= CONFLICT_PENALTY
        if total + (count - 1 - k) <= best:
            break
    return total


@njit
def try_pairs(
    field: Field,
    model: Floats,
    trials: Ints,
    surfaces: Floats,
    count: int,
    start: Floats,
    rule: PairRule,
    out_best: Floats,
) -> None:
    """Best pose that aligns a surface element with one of the model points tried, or the start.

    Original code: RANSAC of oriented points, one pair is a full hypothesis; ours: within limits
    around the start, as the original searches its whole map and may find another room. model
    (n, 5) as in `Model.points`, trials (m,) its rows to try; out_best (2, 4): x, y, theta, score;
    the second row is scratch.
    """
    pose, best = out_best[1], score_pose(field, surfaces, count, start, rule, -math.inf)
    c0, s0 = math.cos(start[2]), math.sin(start[2])
    for i in range(3):
        out_best[0, i] = start[i]
    for t in range(trials.shape[0]):
        m = trials[t]
        x, y, nx, ny = model[m, 0], model[m, 1], model[m, 2], model[m, 3]
        for k in range(count):
            mx = c0 * surfaces[k, 2] - s0 * surfaces[k, 3]
            my = s0 * surfaces[k, 2] + c0 * surfaces[k, 3]
            if mx * nx + my * ny < rule.min_cosine:
                continue
            pose[2] = start[2] + math.atan2(mx * ny - my * nx, mx * nx + my * ny)
            c, s = math.cos(pose[2]), math.sin(pose[2])
            pose[0] = x - c * surfaces[k, 0] + s * surfaces[k, 1]
            pose[1] = y - s * surfaces[k, 0] - c * surfaces[k, 1]
            if math.hypot(pose[0] - start[0], pose[1] - start[1]) > rule.max_distance:
                continue
            score = score_pose(field, surfaces, count, pose, rule, best)
            if score > best:
                best = score
                for i in range(3):
                    out_best[0, i] = pose[i]
    out_best[0, 3] = best
