"""The matcher of the published program: hill climb on a score, likelihood of a scan."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gmapping.tile_kernels import TILE_BITS, Tiles, cell_of, index_in_tile, slot_of
from slams.jit import njit
from slams.types import Floats

NO_HIT = math.inf
CLIMB_MOVES = ((1, 0, 0), (-1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1))


class ClimbModel(NamedTuple):
    """Constants of score, climb and likelihood.

    `sigma`, `lsigma` [m^2] divide squared distances in score and likelihood; `lstep` [m], `astep`
    [rad]: first step of the climb; `iterations`: its halvings; `missed` [m^2]: squared distance of
    a beam without a hit nearby; `minimum_score`: a match must exceed it.
    """

    sigma: float
    lsigma: float
    lstep: float
    astep: float
    iterations: int
    missed: float
    minimum_score: float


@njit(inner=True, borrows=True)
def nearest(tiles: Tiles, particle: int, ix: int, iy: int, x: float, y: float) -> float:
    """Squared distance [m^2] to the nearest mean hit in the 3 x 3 cells around, inf if none.

    [Grisetti07] original code; ours: only cells in the neighbor mask are read. ix, iy: cell of the
    point x, y [m].
    """
    center_slot, best = slot_of(tiles, particle, 0, ix, iy), NO_HIT
    if center_slot == 0:
        return best
    mask = int(tiles.cells[center_slot, index_in_tile(ix, iy), 3])
    for bit in range(9):
        if mask & (1 << bit) == 0:
            continue
        jx, jy = ix + bit // 3 - 1, iy + bit % 3 - 1
        slot, k = center_slot, index_in_tile(jx, jy)
        if jx >> TILE_BITS != ix >> TILE_BITS or jy >> TILE_BITS != iy >> TILE_BITS:
            slot = slot_of(tiles, particle, 0, jx, jy)
        dx, dy = x - tiles.cells[slot, k, 0], y - tiles.cells[slot, k, 1]
        best = min(best, dx * dx + dy * dy)
    return best


@njit(inner=True, borrows=True)
def score(
    tiles: Tiles, particle: int, pose: Floats, points: Floats, sigma: float, floor: float
) -> float:
    """Sum over beams of exp(-d^2 / sigma), d to the nearest mean hit.

    [Grisetti07] original code. ours: stops with a partial sum once `floor` is out of reach; the
    climb's result is the same. pose (3,), points (n, 2).
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    total, left, x0, y0 = 0.0, points.shape[0], pose[0], pose[1]
    per_cell, per_sigma = 1.0 / tiles.resolution, 1.0 / sigma
    for i in range(points.shape[0]):
        if total + left <= floor:
            break
        left -= 1
        x = x0 + c * points[i, 0] - s * points[i, 1]
        y = y0 + s * points[i, 0] + c * points[i, 1]
        ix, iy = math.floor(x * per_cell + 0.5), math.floor(y * per_cell + 0.5)
        d2 = nearest(tiles, particle, ix, iy, x, y)
        if d2 < NO_HIT:
            total += math.exp(-d2 * per_sigma)
    return total


@njit(inner=True, borrows=True)
def log_likelihood(
    tiles: Tiles, particle: int, pose: Floats, points: Floats, model: ClimbModel
) -> float:
    """Log likelihood of a scan: per beam -d^2 / lsigma, or -missed / lsigma without a hit nearby.

    [Grisetti07] original code. pose (3,), points (n, 2).
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    total = 0.0
    for i in range(points.shape[0]):
        x = pose[0] + c * points[i, 0] - s * points[i, 1]
        y = pose[1] + s * points[i, 0] + c * points[i, 1]
        ix, iy = cell_of(x, tiles.resolution), cell_of(y, tiles.resolution)
        d2 = nearest(tiles, particle, ix, iy, x, y)
        total -= d2 if d2 < NO_HIT else model.missed
    return total / model.lsigma


@njit(inner=True)
def hill_climb(
    tiles: Tiles, particle: int, points: Floats, model: ClimbModel, pose: Floats
) -> float:
    """Move to the best of six neighbors; halve the step where none is better; returns the score.

    [Grisetti07] original code. points (n, 2); pose (3,) start in, peak out.
    """
    trial, start = np.empty(3), np.empty(3)
    current = score(tiles, particle, pose, points, model.sigma, -1.0)
    best, lstep, astep, refinements = -1.0, model.lstep, model.astep, 0
    while True:
        if best >= current:
            refinements += 1
            lstep, astep = 0.5 * lstep, 0.5 * astep
        best = current
        for j in range(3):
            start[j] = pose[j]
        for move in CLIMB_MOVES:
            trial[0] = start[0] + move[0] * lstep
            trial[1] = start[1] + move[1] * lstep
            trial[2] = start[2] + move[2] * astep
            value = score(tiles, particle, trial, points, model.sigma, current)
            if value > current:
                current = value
                for j in range(3):
                    pose[j] = trial[j]
        if not (current > best or refinements < model.iterations):
            return best


@njit
def climb_all(
    tiles: Tiles, points: Floats, model: ClimbModel, poses: Floats, out_log_w: Floats
) -> int:
    """Match every particle to its own map and weigh it; returns the number of failed matches.

    [Grisetti07] original code: the pose becomes the peak, without a draw around it. Where the score
    does not exceed `minimum_score`, the pose is unchanged. points (n, 2); poses (particles, 3) in
    and out; out_log_w (particles,).
    """
    pose = np.empty(3)
    failed = 0
    for i in range(poses.shape[0]):
        for j in range(3):
            pose[j] = poses[i, j]
        if hill_climb(tiles, i, points, model, pose) > model.minimum_score:
            for j in range(3):
                poses[i, j] = pose[j]
        else:
            failed += 1
        out_log_w[i] = log_likelihood(tiles, i, poses[i], points, model)
    return failed
