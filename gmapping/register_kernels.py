"""Where a scan lies in a map of surfaces: Gauss-Newton, lattice search, improved proposal."""

from __future__ import annotations

import math

import numpy as np

from gmapping.surface_kernels import SurfaceModel, facing
from gmapping.tile_kernels import Tiles, cell_of, inside_tile, slot_of
from slams.jit import njit
from slams.types import Floats

STILL = 1e-5  # a step [m, rad] below which the peak is found


@njit
def linearize(
    tiles: Tiles, particle: int, pose: Floats, surface: Floats, width: float, out: Floats
) -> None:
    """Normal equations of the distances between a scan and a map, robustly weighted.

    ours: residual = distance of the point from the mean line of its cell, Geman-McClure weights
    of scale `width` [m]. surface (n, 4); out (12,): the upper triangle of H = J^T W J, J^T W r
    (3), the cost [m^2], how many points met a surface, how many within `width`.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    edge, k2 = tiles.resolution, width * width
    hxx = hxy = hxt = hyy = hyt = htt = gx = gy = gt = cost = 0.0
    known = close = 0
    for i in range(surface.shape[0]):
        x, y, nx, ny = surface[i, 0], surface[i, 1], surface[i, 2], surface[i, 3]
        rx, ry = c * x - s * y, s * x + c * y
        px, py = pose[0] + rx, pose[1] + ry
        ix, iy = cell_of(px, edge), cell_of(py, edge)
        slot = slot_of(tiles, particle, facing(c * nx - s * ny, s * nx + c * ny), ix, iy)
        cost += k2
        if slot < 0:
            continue
        cell = tiles.cells[slot, inside_tile(ix, iy)]
        if cell[3] <= 0.0:
            continue
        ax, ay = cell[1], cell[2]
        r = cell[0] + ax * (px - ix * edge) + ay * (py - iy * edge)
        q = k2 / (k2 + r * r)
        known += 1
        close += r * r < k2
        cost -= q * k2
        w = q * q * cell[3] / (cell[3] + 1.0)
        at = ay * rx - ax * ry
        hxx, hxy, hxt = hxx + w * ax * ax, hxy + w * ax * ay, hxt + w * ax * at
        hyy, hyt, htt = hyy + w * ay * ay, hyt + w * ay * at, htt + w * at * at
        gx, gy, gt = gx + w * ax * r, gy + w * ay * r, gt + w * at * r
    out[0], out[1], out[2], out[3], out[4], out[5] = hxx, hxy, hxt, hyy, hyt, htt
    out[6], out[7], out[8] = gx, gy, gt
    out[9], out[10], out[11] = cost, known, close


@njit
def cholesky(h: Floats, out: Floats) -> float:
    """Factor L of the symmetric 3x3 matrix h = L L^T; returns log det h, -inf if not positive.

    ours. h (>= 6,) upper triangle row by row; out (6,) L column by column.
    """
    out[0] = math.sqrt(max(h[0], 0.0))
    out[1], out[2] = h[1] / out[0], h[2] / out[0]
    out[3] = math.sqrt(max(h[3] - out[1] * out[1], 0.0))
    out[4] = (h[4] - out[1] * out[2]) / out[3]
    out[5] = math.sqrt(max(h[5] - out[2] * out[2] - out[4] * out[4], 0.0))
    det = out[0] * out[3] * out[5]
    return 2.0 * math.log(det) if det > 0.0 else -math.inf


@njit
def backward(factor: Floats, g0: float, g1: float, g2: float, out: Floats) -> None:
    """Solve L^T out = g; with g normal, out is drawn from N(0, h^-1). ours."""
    out[2] = g2 / factor[5]
    out[1] = (g1 - factor[4] * out[2]) / factor[3]
    out[0] = (g0 - factor[1] * out[1] - factor[2] * out[2]) / factor[0]


@njit
def posterior(
    found: Floats,
    points: int,
    model: SurfaceModel,
    information: Floats,
    prior: Floats,
    pose: Floats,
) -> float:
    """Negative log of likelihood x prior; of so many points only a part is independent.

    ours: in place of the original's gain over all particles. found (12,) of `linearize`;
    information (6,) upper triangle and prior (3,) of the motion; pose (3,).
    """
    x, y, t = pose[0] - prior[0], pose[1] - prior[1], pose[2] - prior[2]
    squares: float = information[0] * x * x + information[3] * y * y + information[5] * t * t
    products: float = information[1] * x * y + information[2] * x * t + information[4] * y * t
    temper = model.independent / max(float(points), model.independent)
    cost: float = found[9]
    return 0.5 * temper * cost / (model.sigma * model.sigma) + 0.5 * squares + products


@njit
def register(
    tiles: Tiles,
    particle: int,
    surface: Floats,
    prior: Floats,
    information: Floats,
    model: SurfaceModel,
    pose: Floats,
    out: Floats,
) -> float:
    """Climb to the peak of likelihood x prior by Gauss-Newton; returns its negative log.

    [Grisetti07] sec. III-B: the scan matcher in front of the improved proposal; ours: Gauss-Newton
    in place of a hill climb. prior (3,), information (6,) of the motion; pose (3,) start in, peak
    out; out (12,) of `linearize` at the peak, H in units of information, the prior in it.
    """
    factor, step, g = np.empty(6), np.empty(3), np.empty(3)
    scale = 1.0 / (model.sigma * model.sigma)
    width = model.wide
    for _ in range(model.steps):
        linearize(tiles, particle, pose, surface, width, out)
        dx, dy, dt = pose[0] - prior[0], pose[1] - prior[1], pose[2] - prior[2]
        for j in range(6):
            out[j] = out[j] * scale + information[j]
        if cholesky(out, factor) == -math.inf:
            break
        g[0] = -out[6] * scale - information[0] * dx - information[1] * dy - information[2] * dt
        g[1] = -out[7] * scale - information[1] * dx - information[3] * dy - information[4] * dt
        g[2] = -out[8] * scale - information[2] * dx - information[4] * dy - information[5] * dt
        g[0] /= factor[0]
        g[1] = (g[1] - factor[1] * g[0]) / factor[3]
        g[2] = (g[2] - factor[2] * g[0] - factor[4] * g[1]) / factor[5]
        backward(factor, g[0], g[1], g[2], step)
        for j in range(3):
            pose[j] += step[j]
        if width == model.width and max(abs(step[0]), abs(step[1]), abs(step[2])) < STILL:
            break
        width = max(model.width, 0.5 * width)
    return posterior(out, surface.shape[0], model, information, prior, pose)


@njit
def search(
    tiles: Tiles,
    particle: int,
    surface: Floats,
    prior: Floats,
    information: Floats,
    window: Floats,
    model: SurfaceModel,
    out_pose: Floats,
) -> None:
    """The best pose on a lattice around the prior, a start for `register`.

    ours: correlative search with the cost of `register` at the wide width. window (6,): half
    width of the lattice and its step in x, y [m] and theta [rad].
    """
    found, pose = np.empty(12), np.empty(3)
    nx, ny, nt = int(window[0] / window[3]), int(window[1] / window[4]), int(window[2] / window[5])
    best = math.inf
    for it in range(-nt, nt + 1):
        for iy in range(-ny, ny + 1):
            for ix in range(-nx, nx + 1):
                pose[0] = prior[0] + ix * window[3]
                pose[1] = prior[1] + iy * window[4]
                pose[2] = prior[2] + it * window[5]
                linearize(tiles, particle, pose, surface, model.wide, found)
                cost = posterior(found, surface.shape[0], model, information, prior, pose)
                if cost < best:
                    best = cost
                    out_pose[0], out_pose[1], out_pose[2] = pose[0], pose[1], pose[2]


@njit
def propose(
    tiles: Tiles,
    surface: Floats,
    information: Floats,
    model: SurfaceModel,
    draws: Floats,
    poses: Floats,
    out_log_w: Floats,
) -> None:
    """Improved proposal of every particle: a Gaussian around its peak, one draw, its weight.

    [Grisetti07] sec. III-A, III-B; ours: the Gaussian is Laplace's at the peak instead of a fit to
    samples, so the weight is the peak's posterior x sqrt(det 2 pi H^-1). information (particles,
    6) of the motion; draws (particles, 3) of N(0, spread^2); poses (particles, 3) prediction in,
    draw out; out_log_w (particles,).
    """
    prior, pose, step = np.empty(3), np.empty(3), np.empty(3)
    found, factor = np.empty(12), np.empty(6)
    for i in range(poses.shape[0]):
        for j in range(3):
            prior[j] = pose[j] = poses[i, j]
        cost = register(tiles, i, surface, prior, information[i], model, pose, found)
        log_det = cholesky(found, factor)
        out_log_w[i] = -cost
        if log_det > -math.inf:
            out_log_w[i] -= 0.5 * log_det
            backward(factor, draws[i, 0], draws[i, 1], draws[i, 2], step)
            for j in range(3):
                poses[i, j] = pose[j] + step[j]
