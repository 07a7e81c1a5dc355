"""The paper's matcher: end points near mean hits, a hill climb, a Gaussian of samples."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gmapping.match_kernels import Posterior
from gmapping.render_kernels import Counts, is_free
from gmapping.tile_kernels import Tiles, cell_of, inside_tile, slot_of
from slams.geometry import mahalanobis_squared, offset, student_cost
from slams.jit import FAST, njit
from slams.types import Floats, Pose2

GAIN = 1e-6  # of a log posterior; a neighbor that is better by less is so by rounding
DROP = 1.0  # of the log posterior from the peak to a sample beside it: about a deviation
LOOKS = 6  # for a step at which it drops by DROP, less or more by CLOSE times
CLOSE, WIDER = 2.0, 3.0  # WIDER at most, from look to look
FAINT = 7.0  # of the log posterior below the peak, from where a sample weighs nothing
BETTER = 50.0  # of the log posterior above the peak: then the mean is there, and no sum overflows
LEAST = 1e-12  # variance [m^2, rad^2] that samples leave at least


class Field(NamedTuple):
    """How likely an end point is, by its distance from the nearest mean hit.

    `worth` [1/m^2] of its square; `soft` [m] from where it counts as an outlier; `way` [m] and
    `turn` [rad] the first step of the climb, halved `halvings` times.
    """

    worth: float
    soft: float
    way: float
    turn: float
    halvings: int


@njit(fastmath=FAST, inner=True, borrows=True)  # sums may be regrouped
def distances(
    tiles: Tiles, particle: int, pose: Floats, ends: Floats, soft: float, most: float
) -> tuple[float, float]:
    """Sum of end points' squared distances [m^2] from the nearest mean hits; beams within `soft`.

    [Grisetti07] beam end point model; ours: a distance beyond `soft` [m] counts less (Geman and
    McClure), one without a hit near as `soft`. Given up beyond `most` [m^2].
    pose (3,); ends (n, 5) x, y [m], two unused, beams.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    edge, k2, total, close = tiles.resolution, soft * soft, 0.0, 0.0
    for i in range(ends.shape[0]):
        x = pose[0] + c * ends[i, 0] - s * ends[i, 1]
        y = pose[1] + s * ends[i, 0] + c * ends[i, 1]
        ix, iy = cell_of(x, edge), cell_of(y, edge)
        slot, beams = slot_of(tiles, particle, 0, ix, iy), ends[i, 4]
        square = -1.0
        if slot > 0:
            cell = tiles.cells[slot, inside_tile(ix, iy)]
            if cell[5] > 0.0:
                square = (x - cell[3]) ** 2 + (y - cell[4]) ** 2
        total += beams * (k2 * square / (k2 + square) if square >= 0.0 else k2)
        if 0.0 <= square < k2:
            close += beams
        if total > most:
            break
    return total, close


@njit
def log_posterior(of: Posterior, field: Field, k: int, pose: Floats, floor: float) -> float:
    """Log of likelihood x prior of a pose; where it does not exceed `floor`, anything below that.

    [Grisetti07] the target of the improved proposal; ours: the prior by Student's law as in
    `add_prior`. pose (3,), the k-th.
    """
    mean = of.means[k]
    off = offset(Pose2(pose[0], pose[1], pose[2]), Pose2(mean[0], mean[1], mean[2]))
    prior = -student_cost(mahalanobis_squared(of.information, off))
    most = 2.0 * (prior - floor) / field.worth
    if most <= 0.0:
        return floor
    total, _ = distances(of.tiles, of.owners[k], pose, of.pieces, field.soft, most)
    return prior - 0.5 * field.worth * total


@njit
def climb(of: Posterior, field: Field, poses: Floats, out: Floats) -> None:
    """Move to a better one of six neighbors; where none is, halve the step.

    [Grisetti07] scan matching in front of the proposal; ours: with the prior. poses (k, 3) starts
    in, peaks out; out (k,) the log posterior there.
    """
    for k in range(poses.shape[0]):
        pose = poses[k]
        best = log_posterior(of, field, k, pose, -math.inf)
        way, turn, halvings = field.way, field.turn, 0
        while halvings <= field.halvings:
            moved = False
            for move in range(6):
                axis = move >> 1
                before = pose[axis]
                step = turn if axis == 2 else way
                pose[axis] = before + (step if move & 1 else -step)
                value = log_posterior(of, field, k, pose, best)
                if value > best + GAIN:
                    best, moved = value, True
                else:
                    pose[axis] = before
            if not moved:
                way, turn, halvings = 0.5 * way, 0.5 * turn, halvings + 1
        out[k] = best


@njit
def widths(of: Posterior, field: Field, k: int, peak: Floats, reach: Floats) -> None:
    """How far from a peak the log posterior has dropped by `DROP`, along x, y, theta.

    ours: in place of the paper's fixed interval. peak (3,) of the k-th pose; reach (3,) [m, m, rad]
    a guess in, that out.
    """
    trial = peak.copy()
    best = log_posterior(of, field, k, trial, -math.inf)
    for axis in range(3):
        for _ in range(LOOKS):
            drop = best
            for side in (-1.0, 1.0):
                trial[axis] = peak[axis] + side * reach[axis]
                drop -= 0.5 * log_posterior(of, field, k, trial, -math.inf)
            drop = max(drop, DROP / (WIDER * WIDER))
            if CLOSE * drop > DROP and drop < CLOSE * DROP:
                break
            reach[axis] *= math.sqrt(DROP / drop)
        trial[axis] = peak[axis]


@njit
def sample(of: Posterior, field: Field, poses: Floats, out_covariance: Floats, out: Floats) -> None:
    """The Gaussian of 27 samples around each peak, weighed by likelihood x prior.

    [Grisetti07] improved proposal: mean, covariance and eta, the sum of the weights. ours: the
    samples lie on a lattice, as far apart as the posterior is wide. poses (k, 3) peaks in, means
    out; out_covariance (k, 3, 3), zeros in; out (k,) log posterior of the peaks in, log eta out.
    """
    trial, mean = np.empty(3), np.empty(3)
    reach = np.array((field.way, field.way, field.turn))  # of one particle the guess for the next
    for k in range(poses.shape[0]):
        pose, square = poses[k], out_covariance[k]
        widths(of, field, k, pose, reach)
        total, mean[0], mean[1], mean[2] = 0.0, 0.0, 0.0, 0.0
        for number in range(27):
            off = (number // 9 - 1.0, number // 3 % 3 - 1.0, number % 3 - 1.0)
            for i in range(3):
                trial[i] = pose[i] + off[i] * reach[i]
            value = log_posterior(of, field, k, trial, out[k] - FAINT)
            weight = math.exp(min(value - out[k], BETTER))
            total += weight
            for i in range(3):
                mean[i] += weight * off[i]
                for j in range(3):
                    square[i, j] += weight * off[i] * off[j]
        for i in range(3):
            pose[i] += reach[i] * mean[i] / total
            for j in range(3):
                spread = square[i, j] / total - mean[i] * mean[j] / (total * total)
                square[i, j] = reach[i] * reach[j] * spread
            square[i, i] += LEAST
        out[k] += math.log(total * reach[0] * reach[1] * reach[2])


@njit
def evaluate(
    tiles: Tiles, owner: int, ends: Floats, pose: Floats, seen: Counts
) -> tuple[float, float]:
    """Beams of a scan that are inliers at a pose (3,), and that are in conflict with the map.

    ours: an inlier ends less than a cell's edge from a mean hit, a conflict where beams came by and
    nothing is known to stand. ends (n, 5).
    """
    conflicts = 0.0
    c, s, edge = math.cos(pose[2]), math.sin(pose[2]), tiles.resolution
    for i in range(ends.shape[0]):
        x = pose[0] + c * ends[i, 0] - s * ends[i, 1]
        y = pose[1] + s * ends[i, 0] + c * ends[i, 1]
        ix, iy = cell_of(x, edge), cell_of(y, edge)
        slot = slot_of(tiles, owner, 0, ix, iy)
        known = slot > 0 and tiles.cells[slot, inside_tile(ix, iy), 5] > 0.0
        if not known and is_free(seen, x, y):
            conflicts += ends[i, 4]
    return distances(tiles, owner, pose, ends, edge, math.inf)[1], conflicts
