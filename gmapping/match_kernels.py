"""Scan matching in a map of surfaces: Gauss-Newton from many starts at once."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gmapping.map_kernels import confidence, index_in_layer, is_old, layer_of
from gmapping.render_kernels import BeamCounts, is_free
from gmapping.tile_kernels import Tiles, cell_of, slot_of
from slams.geometry import add_prior, offset, solve3
from slams.jit import FAST, njit
from slams.types import Floats, Pose2

SETTLED_STEP_PER_SCALE = 0.1  # a longer step does not reduce the robust scale
PEAK_TOLERANCE = 1e-5  # m, rad: a step below it ends the search


class Posterior(NamedTuple):
    """Likelihood x prior of k poses, each in the map of a particle.

    `owners` (k,): the particles; `pieces` (n, 5) of the scan: x, y [m], nx, ny in the base frame,
    beams; the prior has the `means` (k, 3) and one `information` (3, 3) [1/m^2, 1/(m rad),
    1/rad^2] for all.
    """

    tiles: Tiles
    owners: NDArray[np.int64]
    pieces: Floats
    means: Floats
    information: Floats


class GaussNewton(NamedTuple):
    """Settings of the Gauss-Newton iteration.

    `first_scale`, `last_scale` [m]: of the Geman-McClure weights at the first step and at the last;
    `max_steps`; `variance` [m^2] of a beam's distance, against the prior; `old_path_length` [m]:
    surfaces that were first observed before it are old; for the first `hold_steps` steps the scale
    falls only where the pose has settled.
    """

    first_scale: float
    last_scale: float
    max_steps: int
    variance: float
    old_path_length: float
    hold_steps: int = 0


@njit(fastmath=FAST, inner=True, borrows=True)  # sums may be regrouped
def linearize(
    target: Posterior, k: int, pose: Floats, scale: float, old: float, out_h: Floats, out: Floats
) -> None:
    """Normal equations of the distances between a scan and a map, robustly weighted.

    ours: residual r = distance of a point from the mean line of its cell, Geman-McClure weights of
    `scale` [m]. pose (3,), the k-th; out_h (3, 3) J^T W J; out (7,): -J^T W r (3), the cost [m^2],
    the beams within `scale`, the mean square distance [m^2], and the old score [m^2]: the reduction
    of the cost by surfaces that were first observed before the path length `old` [m].
    """
    tiles, particle, surface = target.tiles, target.owners[k], target.pieces
    c, s = math.cos(pose[2]), math.sin(pose[2])
    edge, k2 = tiles.resolution, scale * scale
    hxx = hxy = hxt = hyy = hyt = htt = gx = gy = gt = 0.0
    cost = inliers = total = squares = old_score = 0.0
    for i in range(surface.shape[0]):
        x, y, nx, ny = surface[i, 0], surface[i, 1], surface[i, 2], surface[i, 3]
        rx, ry = c * x - s * y, s * x + c * y
        px, py = pose[0] + rx, pose[1] + ry
        ix, iy = cell_of(px, edge), cell_of(py, edge)
        layer = layer_of(tiles, c * nx - s * ny, s * nx + c * ny)
        slot = slot_of(tiles, particle, layer, ix, iy)
        cost += surface[i, 4] * k2
        if slot == 0:
            continue
        cell = tiles.cells[slot, index_in_layer(layer, ix, iy)]
        if cell[3] <= 0.0:
            continue
        ax, ay = cell[1], cell[2]
        r = cell[0] + ax * (px - ix * edge) + ay * (py - iy * edge)
        q = k2 / (k2 + r * r)
        if r * r < k2:
            inliers += surface[i, 4]
        cost -= surface[i, 4] * q * k2
        if is_old(cell[4], old):
            old_score += surface[i, 4] * q * k2
        w = surface[i, 4] * q * q * confidence(cell[4])
        total += w
        squares += w * r * r
        at = ay * rx - ax * ry
        hxx, hxy, hxt = hxx + w * ax * ax, hxy + w * ax * ay, hxt + w * ax * at
        hyy, hyt, htt = hyy + w * ay * ay, hyt + w * ay * at, htt + w * at * at
        gx, gy, gt = gx - w * ax * r, gy - w * ay * r, gt - w * at * r
    out_h[0, 0], out_h[1, 1], out_h[2, 2] = hxx, hyy, htt
    out_h[1, 0] = out_h[0, 1] = hxy
    out_h[2, 0] = out_h[0, 2] = hxt
    out_h[2, 1] = out_h[1, 2] = hyt
    out[0], out[1], out[2], out[3], out[4] = gx, gy, gt, cost, inliers
    out[5] = squares / total if total > 0.0 else 0.0
    out[6] = old_score


@njit
def register(
    target: Posterior, settings: GaussNewton, poses: Floats, out_h: Floats, out: Floats
) -> None:
    """Gauss-Newton from every start to a peak of likelihood x prior.

    [Grisetti07] scan matcher in front of the improved proposal; ours: Gauss-Newton in place of a
    hill climb, and a prior with heavy tails. The robust scale falls only after the pose has
    settled, or after `hold_steps`: side walls match anywhere along a corridor, and a small scale
    would reject the few hits at its end before they have moved the pose. poses (k, 3) starts in,
    peaks out; out_h (k, 3, 3), out (k, 7) of `linearize` at the last step.
    """
    step, total_h = np.empty(3), np.empty((3, 3))
    for k in range(poses.shape[0]):
        pose, h, g = poses[k], out_h[k], out[k]
        mean = Pose2(target.means[k, 0], target.means[k, 1], target.means[k, 2])
        scale = settings.first_scale
        for number in range(settings.max_steps):
            linearize(target, k, pose, scale, settings.old_path_length, h, g)
            difference = offset(Pose2(pose[0], pose[1], pose[2]), mean)
            add_prior(h, target.information, settings.variance, difference, total_h, g)
            if not solve3(total_h, g, step):
                break
            for i in range(3):
                pose[i] += step[i]
            longest = max(abs(step[0]), abs(step[1]), abs(step[2]))
            if scale == settings.last_scale and longest < PEAK_TOLERANCE:
                break
            settled = step[0] * step[0] + step[1] * step[1] < (SETTLED_STEP_PER_SCALE * scale) ** 2
            if settled or number >= settings.hold_steps:
                scale = max(settings.last_scale, 0.5 * scale)


@njit
def evaluate(
    tiles: Tiles, owner: int, surface: Floats, pose: Floats, scale: float, counts: BeamCounts
) -> tuple[float, float]:
    """Beams of a scan that are inliers at a pose (3,), by robust weight, and beams in conflict.

    ours: a beam is in conflict if it ends in free space, by `counts`, in a cell without a surface.
    surface (n, 5); `scale` [m] as in `linearize`.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    edge, k2, inliers, conflicts = tiles.resolution, scale * scale, 0.0, 0.0
    for i in range(surface.shape[0]):
        x, y, nx, ny = surface[i, 0], surface[i, 1], surface[i, 2], surface[i, 3]
        px, py = pose[0] + c * x - s * y, pose[1] + s * x + c * y
        ix, iy = cell_of(px, edge), cell_of(py, edge)
        layer = layer_of(tiles, c * nx - s * ny, s * nx + c * ny)
        slot, index = slot_of(tiles, owner, layer, ix, iy), index_in_layer(layer, ix, iy)
        if slot > 0 and tiles.cells[slot, index, 3] > 0.0:
            cell = tiles.cells[slot, index]
            r = cell[0] + cell[1] * (px - ix * edge) + cell[2] * (py - iy * edge)
            inliers += surface[i, 4] * k2 / (k2 + r * r)
        elif is_free(counts, px, py):
            conflicts += surface[i, 4]
    return inliers, conflicts
