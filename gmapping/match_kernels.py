"""Where a scan lies in a map of surfaces: Gauss-Newton from many starts at once."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gmapping.map_kernels import facing, is_old, place_of, trust
from gmapping.tile_kernels import Tiles, cell_of, slot_of
from slams.geometry import add_prior, offset, solve3
from slams.jit import FAST, njit
from slams.types import Floats, Pose2

BEFORE = 0.25  # m before its end that a beam is followed to, and from the laser
FRONTAL = 0.3  # cosine from which a beam goes through a wall, not along it
SETTLED = 0.1  # of the width: a longer step is not the last one at it
STILL = 1e-5  # a step [m, rad] below which the peak is found


class Prior(NamedTuple):
    """What is believed of poses before the scan: means (k, 3), information (k, 3, 3)."""

    poses: Floats
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


class Around(NamedTuple):
    """Where `search_old` looks.

    `offsets` (k, 3) m, m, rad from a pose; `prices` (k,) what share of the beams each of them has
    to explain more; of the scan's pieces one in `every`.
    """

    offsets: Floats
    prices: Floats
    every: int


class Beams(NamedTuple):
    """Where they come from, x, y [m] in the base frame; one piece in `every` is looked at."""

    x: float
    y: float
    every: int


@njit(fastmath=FAST, inner=True, borrows=True)  # sums may be regrouped
def linearize(
    tiles: Tiles,
    particle: int,
    pose: Floats,
    surface: Floats,
    width: float,
    old: float,
    out_h: Floats,
    out: Floats,
) -> None:
    """Normal equations of the distances between a scan and a map, robustly weighted.

    ours: residual r = distance of the point from the mean line of its cell, Geman-McClure weights
    of scale `width` [m]. pose (3,); surface (n, 5); out_h (3, 3) J^T W J; out (7,): -J^T W r (3),
    the cost [m^2], how many beams lie within `width`, their mean square distance [m^2], and what of
    the cost surfaces have spared that were first seen before the way `old` [m].
    """
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
        if slot < 0:
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
def register(
    tiles: Tiles,
    owners: NDArray[np.int64],
    surface: Floats,
    prior: Prior,
    how: Climb,
    poses: Floats,
    out_h: Floats,
    out: Floats,
) -> None:
    """Climb from every start to a peak of likelihood x prior by Gauss-Newton.

    [Grisetti07] scan matcher in front of the improved proposal; ours: Gauss-Newton in place of a
    hill climb, and a prior with heavy tails. Distances count as outliers sooner only where the pose
    has settled, or has had time to: walls beside fit wherever along them the robot is, and would
    call the few hits at a corridor's end outliers before they have moved it. owners (k,) the
    particle in whose map; poses (k, 3) starts in, peaks out; out_h (k, 3, 3), out (k, 7) of
    `linearize` at the last step.
    """
    step, both = np.empty(3), np.empty((3, 3))
    for k in range(poses.shape[0]):
        pose, h, g = poses[k], out_h[k], out[k]
        mean = Pose2(prior.poses[k, 0], prior.poses[k, 1], prior.poses[k, 2])
        width = how.wide
        for number in range(how.steps):
            linearize(tiles, owners[k], pose, surface, width, how.old, h, g)
            off = offset(Pose2(pose[0], pose[1], pose[2]), mean)
            add_prior(h, prior.information[k], how.variance, off, both, g)
            if not solve3(both, g, step):
                break
            for i in range(3):
                pose[i] += step[i]
            if width == how.width and max(abs(step[0]), abs(step[1]), abs(step[2])) < STILL:
                break
            if step[0] * step[0] + step[1] * step[1] < (SETTLED * width) ** 2 or number >= how.wait:
                width = max(how.width, 0.5 * width)


@njit
def search_old(
    tiles: Tiles,
    owners: NDArray[np.int64],
    surface: Floats,
    around: Around,
    how: Climb,
    poses: Floats,
    out: Floats,
) -> None:
    """Where around its pose each particle's ground of old explains most of a scan.

    ours: share of the beams by robust weight, less the price of the offset. owners (n,) the
    particles; poses (n, 3) in, the best out; out (n,) that share.
    """
    edge, k2, offsets = tiles.resolution, how.wide * how.wide, around.offsets
    for j in range(poses.shape[0]):
        particle, best, value = owners[j], -1, 0.0
        x0, y0, t0 = poses[j, 0], poses[j, 1], poses[j, 2]
        for k in range(offsets.shape[0]):
            pose_x, pose_y = x0 + offsets[k, 0], y0 + offsets[k, 1]
            c, s = math.cos(t0 + offsets[k, 2]), math.sin(t0 + offsets[k, 2])
            spared = beams = 0.0
            for i in range(0, surface.shape[0], around.every):
                x, y, nx, ny = surface[i, 0], surface[i, 1], surface[i, 2], surface[i, 3]
                beams += surface[i, 4]
                px, py = pose_x + c * x - s * y, pose_y + s * x + c * y
                ix, iy = cell_of(px, edge), cell_of(py, edge)
                layer = facing(tiles, c * nx - s * ny, s * nx + c * ny)
                slot = slot_of(tiles, particle, layer, ix, iy)
                if slot < 0:
                    continue
                cell = tiles.cells[slot, place_of(layer, ix, iy)]
                if cell[3] <= 0.0 or not is_old(cell[4], how.old):
                    continue
                r = cell[0] + cell[1] * (px - ix * edge) + cell[2] * (py - iy * edge)
                spared += surface[i, 4] * k2 / (k2 + r * r)
            share = spared / beams
            if share - around.prices[k] > value:
                best, value, out[j] = k, share - around.prices[k], share
        if best >= 0:
            for i in range(3):
                poses[j, i] += offsets[best, i]


@njit
def crossed(
    tiles: Tiles,
    owners: NDArray[np.int64],
    surface: Floats,
    laser: Beams,
    old: float,
    poses: Floats,
    out: Floats,
) -> None:
    """How many beams of a scan go through walls of old ground, from these poses.

    ours: a beam is followed in steps of less than the map's band; it is behind a wall that faces
    the laser where the signed distance is negative. owners (k,) the particle in whose map; poses
    (k, 3); surface (n, 5); `old` [m] as in `Climb`; out (k,) beams.
    """
    edge = tiles.resolution
    for k in range(poses.shape[0]):
        c, s = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        through = 0.0
        for i in range(0, surface.shape[0], laser.every):
            x, y = surface[i, 0] - laser.x, surface[i, 1] - laser.y
            far = math.hypot(x, y)
            if far <= 2.0 * BEFORE:
                continue
            dx, dy = (c * x - s * y) / far, (s * x + c * y) / far
            x0 = poses[k, 0] + c * laser.x - s * laser.y
            y0 = poses[k, 1] + s * laser.x + c * laser.y
            layer, way = facing(tiles, -dx, -dy), BEFORE
            while way < far - BEFORE:
                px, py = x0 + way * dx, y0 + way * dy
                way += 1.5 * edge
                ix, iy = cell_of(px, edge), cell_of(py, edge)
                slot = slot_of(tiles, owners[k], layer, ix, iy)
                if slot < 0:
                    continue
                cell = tiles.cells[slot, place_of(layer, ix, iy)]
                if cell[3] <= 0.0 or not is_old(cell[4], old) or trust(cell[4]) < 1.0:
                    continue
                r = cell[0] + cell[1] * (px - ix * edge) + cell[2] * (py - iy * edge)
                if r < -0.5 * edge and cell[1] * dx + cell[2] * dy < -FRONTAL:
                    through += surface[i, 4]
                    break
        out[k] = through * laser.every
