"""Where a scan lies in a map of surfaces: Gauss-Newton from many starts at once."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gmapping.map_kernels import facing, is_old, place_of, trust
from gmapping.render_kernels import Counts, is_free
from gmapping.tile_kernels import Tiles, cell_of, slot_of
from slams.geometry import add_prior, offset, solve3
from slams.jit import FAST, njit
from slams.types import Floats, Pose2

SETTLED = 0.1  # of the width: a longer step is not the last one at it
STILL = 1e-5  # a step [m, rad] below which the peak is found


class Posterior(NamedTuple):
    """Likelihood x prior of k poses, each in the map of a particle.

    `owners` (k,) the particles; `pieces` (n, 5) of the scan: x, y [m], nx, ny in the base frame,
    beams; before it poses have the `means` (k, 3) and all the same `information` (3, 3) [1/m^2,
    1/(m rad), 1/rad^2].
    """

    tiles: Tiles
    owners: NDArray[np.int64]
    pieces: Floats
    means: Floats
    information: Floats


class Climb(NamedTuple):
    """How a peak is climbed to.

    `wide` and `width` [m] from where a distance counts as an outlier, at the first step and at the
    last; `steps` of Gauss-Newton at most; `variance` [m^2] of a beam's distance, against the prior;
    surfaces first seen before the way `old` [m] are of old ground; for the first `wait` steps the
    scale of outliers stays where the pose has not settled.
    """

    wide: float
    width: float
    steps: int
    variance: float
    old: float
    wait: int = 0


@njit(fastmath=FAST, inner=True, borrows=True)  # sums may be regrouped
def linearize(
    of: Posterior, k: int, pose: Floats, width: float, old: float, out_h: Floats, out: Floats
) -> None:
    """Normal equations of the distances between a scan and a map, robustly weighted.

    ours: residual r = distance of the point from the mean line of its cell, Geman-McClure weights
    of scale `width` [m]. pose (3,), the k-th; out_h (3, 3) J^T W J; out (7,): -J^T W r (3),
    the cost [m^2], how many beams lie within `width`, their mean square distance [m^2], and what of
    the cost surfaces have spared that were first seen before the way `old` [m].
    """
    tiles, particle, surface = of.tiles, of.owners[k], of.pieces
    c, s = math.cos(pose[2]), math.sin(pose[2])
    edge, k2 = tiles.resolution, width * width
    hxx = hxy = hxt = hyy = hyt = htt = gx = gy = gt = cost = close = total = squares = spared = 0.0
    for i in range(surface.shape[0]):
        x, y, nx, ny = surface[i, 0], surface[i, 1], surface[i, 2], surface[i, 3]
        rx, ry = c * x - s * y, s * x + c * y
        px, py = pose[0] + rx, pose[1] + ry
        ix, iy = cell_of(px, edge), cell_of(py, edge)
        layer = facing(tiles, c * nx - s * ny, s * nx + c * ny)
        slot = slot_of(tiles, particle, layer, ix, iy)
        cost += surface[i, 4] * k2
        if slot == 0:
            continue
        cell = tiles.cells[slot, place_of(layer, ix, iy)]
        if cell[3] <= 0.0:
            continue
        ax, ay = cell[1], cell[2]
        r = cell[0] + ax * (px - ix * edge) + ay * (py - iy * edge)
        q = k2 / (k2 + r * r)
        if r * r < k2:
            close += surface[i, 4]
        cost -= surface[i, 4] * q * k2
        if is_old(cell[4], old):
            spared += surface[i, 4] * q * k2
        w = surface[i, 4] * q * q * trust(cell[4])
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
    out[0], out[1], out[2], out[3], out[4] = gx, gy, gt, cost, close
    out[5] = squares / total if total > 0.0 else 0.0
    out[6] = spared


@njit
def register(of: Posterior, how: Climb, poses: Floats, out_h: Floats, out: Floats) -> None:
    """Climb from every start to a peak of likelihood x prior by Gauss-Newton.

    [Grisetti07] scan matcher in front of the improved proposal; ours: Gauss-Newton in place of a
    hill climb, and a prior with heavy tails. Distances count as outliers sooner only where the pose
    has settled, or has had time to: walls beside fit wherever along them the robot is, and would
    call the few hits at a corridor's end outliers before they have moved it. poses (k, 3) starts
    in, peaks out; out_h (k, 3, 3), out (k, 7) of `linearize` at the last step.
    """
    step, both = np.empty(3), np.empty((3, 3))
    for k in range(poses.shape[0]):
        pose, h, g = poses[k], out_h[k], out[k]
        mean = Pose2(of.means[k, 0], of.means[k, 1], of.means[k, 2])
        width = how.wide
        for number in range(how.steps):
            linearize(of, k, pose, width, how.old, h, g)
            off = offset(Pose2(pose[0], pose[1], pose[2]), mean)
            add_prior(h, of.information, how.variance, off, both, g)
            if not solve3(both, g, step):
                break
            for i in range(3):
                pose[i] += step[i]
            if width == how.width and max(abs(step[0]), abs(step[1]), abs(step[2])) < STILL:
                break
            if step[0] * step[0] + step[1] * step[1] < (SETTLED * width) ** 2 or number >= how.wait:
                width = max(how.width, 0.5 * width)


@njit
def evaluate(
    tiles: Tiles, owner: int, surface: Floats, pose: Floats, width: float, seen: Counts
) -> tuple[float, float]:
    """Beams of a scan that are inliers at a pose (3,), by robust weight, and that are in conflict.

    ours: a conflict is an end where beams came by and nothing is known to stand. surface (n, 5);
    `width` [m] as of `linearize`.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    edge, k2, inliers, conflicts = tiles.resolution, width * width, 0.0, 0.0
    for i in range(surface.shape[0]):
        x, y, nx, ny = surface[i, 0], surface[i, 1], surface[i, 2], surface[i, 3]
        px, py = pose[0] + c * x - s * y, pose[1] + s * x + c * y
        ix, iy = cell_of(px, edge), cell_of(py, edge)
        layer = facing(tiles, c * nx - s * ny, s * nx + c * ny)
        slot, place = slot_of(tiles, owner, layer, ix, iy), place_of(layer, ix, iy)
        if slot > 0 and tiles.cells[slot, place, 3] > 0.0:
            cell = tiles.cells[slot, place]
            r = cell[0] + cell[1] * (px - ix * edge) + cell[2] * (py - iy * edge)
            inliers += surface[i, 4] * k2 / (k2 + r * r)
        elif is_free(seen, px, py):
            conflicts += surface[i, 4]
    return inliers, conflicts
