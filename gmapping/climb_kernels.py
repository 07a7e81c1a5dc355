"""The paper's matcher: end points near mean hits, a hill climb, a Gaussian of samples."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gmapping.match_kernels import Posterior
from gmapping.render_kernels import BeamCounts, is_free
from gmapping.tile_kernels import Tiles, cell_of, index_in_tile, slot_of
from slams.geometry import mahalanobis_squared, offset, student_cost
from slams.jit import njit
from slams.types import Floats, Pose2

MIN_CLIMB_GAIN = 1e-6  # of the log posterior; a smaller gain may be rounding
SPACING_DROP = 1.0  # of the log posterior from the peak to a sample: about one deviation
SPACING_DROP_TOLERANCE = 2.0  # factor, either way
MAX_SPACING_TRIALS = 6  # per axis
MAX_SPACING_GROWTH = 3.0  # factor from one trial to the next
NEGLIGIBLE_DROP = 7.0  # of the log posterior below the peak: the sample's weight is computed as 0
MAX_LOG_WEIGHT = 50.0  # of a sample above the peak: the sum cannot overflow
MIN_SAMPLE_VARIANCE = 1e-12  # m^2, rad^2: keeps the covariance invertible


class HitModel(NamedTuple):
    """Likelihood of an end point by its distance from the nearest mean hit, and the climb.

    `information` [1/m^2] of a distance; `scale` [m]: Geman-McClure; `linear_step` [m],
    `angular_step` [rad]: the first step of the climb, halved `halvings` times.
    """

    information: float
    scale: float
    linear_step: float
    angular_step: float
    halvings: int


@njit(inner=True, borrows=True)
def distance_cost(
    tiles: Tiles, particle: int, pose: Floats, ends: Floats, scale: float, max_cost: float
) -> tuple[float, float]:
    """Robust cost [m^2] of the end points' distances from the nearest mean hits, and the inliers.

    [Grisetti07] beam end point model; ours: Geman-McClure cost of scale `scale` [m], which is also
    the cost without a hit near; inliers are the beams within `scale`. Stops beyond `max_cost`
    [m^2]. pose (3,); ends (n, 5) x, y [m], two unused, beams.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    edge, k2, cost, inliers = tiles.resolution, scale * scale, 0.0, 0.0
    for i in range(ends.shape[0]):
        x = pose[0] + c * ends[i, 0] - s * ends[i, 1]
        y = pose[1] + s * ends[i, 0] + c * ends[i, 1]
        ix, iy = cell_of(x, edge), cell_of(y, edge)
        slot, beams = slot_of(tiles, particle, 0, ix, iy), ends[i, 4]
        square = -1.0
        if slot > 0:
            cell = tiles.cells[slot, index_in_tile(ix, iy)]
            if cell[5] > 0.0:
                square = (x - cell[3]) ** 2 + (y - cell[4]) ** 2
        cost += beams * (k2 * square / (k2 + square) if square >= 0.0 else k2)
        if 0.0 <= square < k2:
            inliers += beams
        if cost > max_cost:
            break
    return cost, inliers


@njit(inner=True)
def log_posterior(target: Posterior, model: HitModel, k: int, pose: Floats, floor: float) -> float:
    """Log of likelihood x prior of a pose (3,), the k-th; any value below `floor` if not above it.

    [Grisetti07] the target of the improved proposal; ours: Student's t prior as in `add_prior`.
    """
    mean = target.means[k]
    difference = offset(Pose2(pose[0], pose[1], pose[2]), Pose2(mean[0], mean[1], mean[2]))
    prior = -student_cost(mahalanobis_squared(target.information, difference))
    max_cost = 2.0 * (prior - floor) / model.information
    if max_cost <= 0.0:
        return floor
    cost, _ = distance_cost(
        target.tiles, target.owners[k], pose, target.pieces, model.scale, max_cost
    )
    return prior - 0.5 * model.information * cost


@njit
def climb(target: Posterior, model: HitModel, poses: Floats, out: Floats) -> None:
    """Hill climb: move to a better one of six neighbors; where none is better, halve the step.

    [Grisetti07] scan matching in front of the proposal; ours: with the prior. poses (k, 3) starts
    in, peaks out; out (k,) the log posterior there.
    """
    for k in range(poses.shape[0]):
        pose = poses[k]
        best = log_posterior(target, model, k, pose, -math.inf)
        linear_step, angular_step, halvings = model.linear_step, model.angular_step, 0
        while halvings <= model.halvings:
            moved = False
            for move in range(6):
                axis = move >> 1
                before = pose[axis]
                step = angular_step if axis == 2 else linear_step
                pose[axis] = before + (step if move & 1 else -step)
                value = log_posterior(target, model, k, pose, best)
                if value > best + MIN_CLIMB_GAIN:
                    best, moved = value, True
                else:
                    pose[axis] = before
            if not moved:
                halvings += 1
                linear_step, angular_step = 0.5 * linear_step, 0.5 * angular_step
        out[k] = best


@njit(inner=True)
def sample_spacing(
    target: Posterior, model: HitModel, k: int, peak: Floats, spacing: Floats
) -> None:
    """Distance from a peak at which the log posterior has dropped by `SPACING_DROP`, on each axis.

    ours: in place of the paper's fixed interval. peak (3,) of the k-th pose; spacing (3,) [m, m,
    rad]: a guess in, the result out.
    """
    trial = peak.copy()
    best = log_posterior(target, model, k, trial, -math.inf)
    for axis in range(3):
        for _ in range(MAX_SPACING_TRIALS):
            drop = best
            for side in (-1.0, 1.0):
                trial[axis] = peak[axis] + side * spacing[axis]
                drop -= 0.5 * log_posterior(target, model, k, trial, -math.inf)
            drop = max(drop, SPACING_DROP / (MAX_SPACING_GROWTH * MAX_SPACING_GROWTH))
            if SPACING_DROP / SPACING_DROP_TOLERANCE < drop < SPACING_DROP_TOLERANCE * SPACING_DROP:
                break
            spacing[axis] *= math.sqrt(SPACING_DROP / drop)
        trial[axis] = peak[axis]


@njit
def sample(target: Posterior, model: HitModel, poses: Floats, out_cov: Floats, out: Floats) -> None:
    """The Gaussian of 27 samples around each peak, weighted by likelihood x prior.

    [Grisetti07] improved proposal: mean, covariance and eta, the sum of the weights. ours: the
    samples form a lattice whose spacing is the width of the target. poses (k, 3) peaks in, means
    out; out_cov (k, 3, 3), zeros in; out (k,) log posterior of the peaks in, log eta out.
    """
    trial, mean = np.empty(3), np.empty(3)
    # the result of one particle is the guess for the next
    spacing = np.array((model.linear_step, model.linear_step, model.angular_step))
    for k in range(poses.shape[0]):
        pose, square = poses[k], out_cov[k]
        sample_spacing(target, model, k, pose, spacing)
        total, mean[0], mean[1], mean[2] = 0.0, 0.0, 0.0, 0.0
        for number in range(27):
            node = (number // 9 - 1.0, number // 3 % 3 - 1.0, number % 3 - 1.0)
            for i in range(3):
                trial[i] = pose[i] + node[i] * spacing[i]
            value = log_posterior(target, model, k, trial, out[k] - NEGLIGIBLE_DROP)
            weight = math.exp(min(value - out[k], MAX_LOG_WEIGHT))
            total += weight
            for i in range(3):
                mean[i] += weight * node[i]
                for j in range(3):
                    square[i, j] += weight * node[i] * node[j]
        for i in range(3):
            pose[i] += spacing[i] * mean[i] / total
            for j in range(3):
                variance = square[i, j] / total - mean[i] * mean[j] / (total * total)
                square[i, j] = spacing[i] * spacing[j] * variance
            square[i, i] += MIN_SAMPLE_VARIANCE
        out[k] += math.log(total * spacing[0] * spacing[1] * spacing[2])


@njit
def evaluate(
    tiles: Tiles, owner: int, ends: Floats, pose: Floats, counts: BeamCounts
) -> tuple[float, float]:
    """Beams of a scan that are inliers at a pose (3,), and beams in conflict with the map.

    ours: an inlier ends within one cell's edge of a mean hit; a beam is in conflict if it ends in
    free space, by `counts`, with no hit in the cells around. ends (n, 5).
    """
    conflicts = 0.0
    c, s, edge = math.cos(pose[2]), math.sin(pose[2]), tiles.resolution
    for i in range(ends.shape[0]):
        x = pose[0] + c * ends[i, 0] - s * ends[i, 1]
        y = pose[1] + s * ends[i, 0] + c * ends[i, 1]
        ix, iy = cell_of(x, edge), cell_of(y, edge)
        slot = slot_of(tiles, owner, 0, ix, iy)
        has_hit = slot > 0 and tiles.cells[slot, index_in_tile(ix, iy), 5] > 0.0
        if not has_hit and is_free(counts, x, y):
            conflicts += ends[i, 4]
    return distance_cost(tiles, owner, pose, ends, edge, math.inf)[1], conflicts
