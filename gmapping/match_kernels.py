"""Where a scan lies in a map of surfaces: Gauss-Newton from many starts at once."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gmapping.map_kernels import SurfaceModel, facing
from gmapping.tile_kernels import Tiles, cell_of, inside_tile, slot_of
from slams.geometry import solve3
from slams.jit import njit
from slams.types import Floats

STILL = 1e-5  # a step [m, rad] below which the peak is found


class Prior(NamedTuple):
    """What is believed of poses before the scan: means (k, 3), information (k, 3, 3)."""

    poses: Floats
    information: Floats


@njit(inner=True)
def linearize(
    tiles: Tiles,
    particle: int,
    pose: Floats,
    surface: Floats,
    width: float,
    out_h: Floats,
    out: Floats,
) -> None:
    """Normal equations of the distances between a scan and a map, robustly weighted.

    ours: residual r = distance of the point from the mean line of its cell, Geman-McClure weights
    of scale `width` [m]. pose (3,); surface (n, 5); out_h (3, 3) lower triangle of J^T W J; out
    (5,): -J^T W r (3), the cost [m^2], how many beams lie within `width`.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    edge, k2 = tiles.resolution, width * width
    hxx = hxy = hxt = hyy = hyt = htt = gx = gy = gt = cost = close = 0.0
    for i in range(surface.shape[0]):
        x, y, nx, ny = surface[i, 0], surface[i, 1], surface[i, 2], surface[i, 3]
        rx, ry = c * x - s * y, s * x + c * y
        px, py = pose[0] + rx, pose[1] + ry
        ix, iy = cell_of(px, edge), cell_of(py, edge)
        slot = slot_of(tiles, particle, facing(c * nx - s * ny, s * nx + c * ny), ix, iy)
        cost += surface[i, 4] * k2
        if slot < 0:
            continue
        cell = tiles.cells[slot, inside_tile(ix, iy)]
        if cell[3] <= 0.0:
            continue
        ax, ay = cell[1], cell[2]
        r = cell[0] + ax * (px - ix * edge) + ay * (py - iy * edge)
        q = k2 / (k2 + r * r)
        if r * r < k2:
            close += surface[i, 4]
        cost -= surface[i, 4] * q * k2
        w = surface[i, 4] * q * q * cell[3] / (cell[3] + 1.0)
        at = ay * rx - ax * ry
        hxx, hxy, hxt = hxx + w * ax * ax, hxy + w * ax * ay, hxt + w * ax * at
        hyy, hyt, htt = hyy + w * ay * ay, hyt + w * ay * at, htt + w * at * at
        gx, gy, gt = gx - w * ax * r, gy - w * ay * r, gt - w * at * r
    out_h[0, 0], out_h[1, 0], out_h[2, 0] = hxx, hxy, hxt
    out_h[1, 1], out_h[2, 1], out_h[2, 2] = hyy, hyt, htt
    out[0], out[1], out[2], out[3], out[4] = gx, gy, gt, cost, close


@njit
def register(
    tiles: Tiles,
    owners: NDArray[np.int64],
    surface: Floats,
    prior: Prior,
    model: SurfaceModel,
    poses: Floats,
    out_h: Floats,
    out: Floats,
) -> None:
    """Climb from every start to a peak of likelihood x prior by Gauss-Newton.

    [Grisetti07] scan matcher in front of the improved proposal; ours: Gauss-Newton in place of a
    hill climb. owners (k,) the particle in whose map; poses (k, 3) starts in, peaks out; out_h
    (k, 3, 3) the information there, the prior in it; out (k, 5) of `linearize`.
    """
    step = np.empty(3)
    scale = 1.0 / (model.sigma * model.sigma)
    for k in range(poses.shape[0]):
        pose, h, g = poses[k], out_h[k], out[k]
        width = model.wide
        for _ in range(model.steps):
            linearize(tiles, owners[k], pose, surface, width, h, g)
            for i in range(3):
                g[i] *= scale
                for j in range(3):
                    b = prior.information[k, i, j]
                    g[i] -= b * (pose[j] - prior.poses[k, j])
                    if j <= i:
                        h[i, j] = h[i, j] * scale + b
            if not solve3(h, g, step):
                break
            for i in range(3):
                pose[i] += step[i]
            if width == model.width and max(abs(step[0]), abs(step[1]), abs(step[2])) < STILL:
                break
            width = max(model.width, 0.5 * width)
        for i in range(3):
            for j in range(i):
                h[j, i] = h[i, j]
