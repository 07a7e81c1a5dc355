"""Point-to-point ICP with the published gates."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats
from tsd.grid_kernels import Mask

Ints = NDArray[np.int64]


class Buckets(NamedTuple):
    """Points (n, 2) sorted into square buckets: first of each bucket, next of each point.

    `corner` (3,): x, y and edge of the buckets [m], at least `size`.
    """

    first: NDArray[np.int32]
    next: Ints
    points: Floats
    corner: Floats
    size: float


class Links(NamedTuple):
    """Working memory (n,): nearest model point of each scene point, partner of each model point."""

    nearest_of: Ints
    partner: Ints
    d2: Floats


class Gate(NamedTuple):
    """Iterations, greatest and least pair distance [m]."""

    iterations: int
    widest: float
    narrowest: float


@njit
def compact(points: Floats, mask: Mask, out_points: Floats, out_index: Ints) -> int:
    """The valid points, one after the other, and where they stood. Returns how many. ours."""
    count = 0
    for i in range(mask.shape[0]):
        if mask[i]:
            out_points[count, 0] = points[i, 0]
            out_points[count, 1] = points[i, 1]
            out_index[count] = i
            count += 1
    return count


@njit
def fill_buckets(buckets: Buckets, count: int) -> None:
    """Sort the first `count` points into buckets. ours: S1, instead of a kd-tree."""
    buckets.first[:, :] = -1
    x0, y0, x1, y1 = math.inf, math.inf, -math.inf, -math.inf
    for k in range(count):
        x0, x1 = min(x0, buckets.points[k, 0]), max(x1, buckets.points[k, 0])
        y0, y1 = min(y0, buckets.points[k, 1]), max(y1, buckets.points[k, 1])
    buckets.corner[0], buckets.corner[1] = x0, y0
    ny, nx = buckets.first.shape
    buckets.corner[2] = max((x1 - x0) / (nx - 1), (y1 - y0) / (ny - 1), buckets.size)
    for k in range(count):
        ix = int((buckets.points[k, 0] - x0) / buckets.corner[2])
        iy = int((buckets.points[k, 1] - y0) / buckets.corner[2])
        buckets.next[k] = buckets.first[iy, ix]
        buckets.first[iy, ix] = k


@njit
def nearest(buckets: Buckets, x: float, y: float, reach: float, hint: int) -> tuple[int, float]:
    """Nearest point within `reach` [m] and its squared distance; (-1, ...) when there is none.

    ours: exact, rings of buckets outward; `hint` is a point that may well be it, -1 = no idea.
    """
    size = buckets.corner[2]
    u, v = (x - buckets.corner[0]) / size, (y - buckets.corner[1]) / size
    cx, cy = math.floor(u), math.floor(v)
    inside = min(u - cx, v - cy, 1.0 - (u - cx), 1.0 - (v - cy)) * size
    ny, nx = buckets.first.shape
    best, best_d2 = -1, reach * reach
    if hint >= 0:
        dx, dy = buckets.points[hint, 0] - x, buckets.points[hint, 1] - y
        if dx * dx + dy * dy <= best_d2:
            best, best_d2 = hint, dx * dx + dy * dy
    ring, edge = 0, -1.0
    while edge < 0.0 or edge * edge < best_d2:
        for iy in range(max(cy - ring, 0), min(cy + ring + 1, ny)):
            stride = 1 if abs(iy - cy) == ring else max(2 * ring, 1)
            for ix in range(cx - ring, cx + ring + 1, stride):
                if ix < 0 or ix >= nx:
                    continue
                k = buckets.first[iy, ix]
                while k >= 0:
                    dx, dy = buckets.points[k, 0] - x, buckets.points[k, 1] - y
                    if dx * dx + dy * dy < best_d2:
                        best, best_d2 = k, dx * dx + dy * dy
                    k = buckets.next[k]
        edge = inside + ring * size
        ring += 1
    return best, best_d2


@njit
def pair_up(
    buckets: Buckets,
    scene: Floats,
    count: int,
    gate2: float,
    nearest_of: Ints,
    out_partner: Ints,
    out_d2: Floats,
) -> None:
    """For every model point the closest scene point that has it as nearest.

    Original code: nearest neighbor, distance gate and "reciprocal" filter. nearest_of (n,)
    remembers each scene point's nearest model point as hint for the next round.
    """
    out_partner[:] = -1
    reach = math.sqrt(gate2)
    for k in range(count):
        m, d2 = nearest(buckets, scene[k, 0], scene[k, 1], reach, nearest_of[k])
        nearest_of[k] = m
        if m >= 0 and (out_partner[m] < 0 or d2 < out_d2[m]):
            out_partner[m] = k
            out_d2[m] = d2


@njit
def closed_form(model: Floats, scene: Floats, partner: Ints, count: int) -> tuple[int, Floats]:
    """Rigid motion (x, y, theta) of least squared pair distance. Original code: closed form 2D."""
    pairs = 0
    mx, my, sx, sy = 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        if partner[k] >= 0:
            pairs += 1
            mx, my = mx + model[k, 0], my + model[k, 1]
            sx, sy = sx + scene[partner[k], 0], sy + scene[partner[k], 1]
    motion = np.zeros(3)
    if pairs <= 2:
        return pairs, motion
    mx, my, sx, sy = mx / pairs, my / pairs, sx / pairs, sy / pairs
    cross, dot = 0.0, 0.0
    for k in range(count):
        if partner[k] >= 0:
            ax, ay = model[k, 0] - mx, model[k, 1] - my
            bx, by = scene[partner[k], 0] - sx, scene[partner[k], 1] - sy
            cross += ay * bx - ax * by
            dot += ax * bx + ay * by
    motion[2] = math.atan2(cross, dot)
    c, s = math.cos(motion[2]), math.sin(motion[2])
    motion[0] = mx - (c * sx - s * sy)
    motion[1] = my - (s * sx + c * sy)
    return pairs, motion


@njit
def move(points: Floats, count: int, motion: Floats) -> None:
    """Move points in place by (x, y, theta). ours."""
    c, s = math.cos(motion[2]), math.sin(motion[2])
    for k in range(count):
        x, y = points[k, 0], points[k, 1]
        points[k, 0] = motion[0] + c * x - s * y
        points[k, 1] = motion[1] + s * x + c * y


@njit
def icp(
    buckets: Buckets,
    n_model: int,
    scene: Floats,
    n_scene: int,
    gate: Gate,
    links: Links,
    out_motion: Floats,
) -> int:
    """Fixed number of rounds of pairing and closed form; moves the scene, adds to out_motion (3,).

    Original code: ICP; the gate shrinks by a ratio meant for distances but applied to squares
    (D3). Returns the pairs of the last round.
    """
    gate2, floor = gate.widest * gate.widest, gate.narrowest * gate.narrowest
    ratio = (gate.narrowest / gate.widest) ** (1.0 / max(gate.iterations - 11, 1))
    pairs = 0
    links.nearest_of[:] = -1
    for _ in range(gate.iterations):
        pair_up(buckets, scene, n_scene, gate2, links.nearest_of, links.partner, links.d2)
        pairs, motion = closed_form(buckets.points, scene, links.partner, n_model)
        if pairs <= 2:
            break
        move(scene, n_scene, motion)
        c, s = math.cos(motion[2]), math.sin(motion[2])
        x, y = out_motion[0], out_motion[1]
        out_motion[0] = motion[0] + c * x - s * y
        out_motion[1] = motion[1] + s * x + c * y
        out_motion[2] += motion[2]
        gate2 = max(gate2 * ratio, floor)
    return pairs
