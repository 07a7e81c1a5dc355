"""Point-to-point ICP with the published gates."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats
from tsd.original.scan_kernels import Ints


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
    """Working memory: of each scene point its nearest model point, of each model point its partner.

    `second` (n,) [m]: no other model point was closer when the scene point stood at `at` (n, 2).
    """

    nearest_of: Ints
    partner: Ints
    d2: Floats
    second: Floats
    at: Floats


class Gate(NamedTuple):
    """Iterations, greatest and least pair distance [m]."""

    iterations: int
    widest: float
    narrowest: float


@njit
def fill_buckets(buckets: Buckets, count: int) -> None:
    """Sort the first `count` points into buckets. ours, instead of a kd-tree."""
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


@njit(inner=True)
def nearest(
    buckets: Buckets, x: float, y: float, reach: float, hint: int
) -> tuple[int, float, float]:
    """Nearest point within `reach` [m], its squared distance and that of the second nearest.

    (-1, reach2, reach2) when there is none. ours: exact, rings of buckets outward; `hint` is a
    point that may well be it, -1 = no idea.
    """
    size = buckets.corner[2]
    u, v = (x - buckets.corner[0]) / size, (y - buckets.corner[1]) / size
    cx, cy = math.floor(u), math.floor(v)
    inside = min(u - cx, v - cy, 1.0 - (u - cx), 1.0 - (v - cy)) * size
    ny, nx = buckets.first.shape
    best, best_d2, second_d2 = -1, reach * reach, reach * reach
    if hint >= 0:
        dx, dy = buckets.points[hint, 0] - x, buckets.points[hint, 1] - y
        if dx * dx + dy * dy <= best_d2:
            best, best_d2 = hint, dx * dx + dy * dy
    ring, edge = 0, -1.0
    while edge < 0.0 or edge * edge < second_d2:
        for iy in range(max(cy - ring, 0), min(cy + ring + 1, ny)):
            stride = 1 if abs(iy - cy) == ring else max(2 * ring, 1)
            for ix in range(cx - ring, cx + ring + 1, stride):
                if ix < 0 or ix >= nx:
                    continue
                k = buckets.first[iy, ix]
                while k >= 0:
                    dx, dy = buckets.points[k, 0] - x, buckets.points[k, 1] - y
                    d2 = dx * dx + dy * dy
                    if d2 < best_d2:
                        best, best_d2, second_d2 = k, d2, best_d2
                    elif d2 < second_d2 and k != best:
                        second_d2 = d2
                    k = buckets.next[k]
        edge = inside + ring * size
        ring += 1
    return best, best_d2, second_d2


@njit(inner=True)
def pair_up(buckets: Buckets, scene: Floats, count: int, gate2: float, links: Links) -> None:
    """For every model point the closest scene point that has it as nearest.

    Original code: nearest neighbor, distance gate and "reciprocal" filter. ours: a scene point
    that moved less than the lead of its nearest over the second nearest keeps it unsearched.
    """
    for m in range(links.partner.shape[0]):
        links.partner[m] = -1
    reach = math.sqrt(gate2)
    for k in range(count):
        x, y, m = scene[k, 0], scene[k, 1], links.nearest_of[k]
        dx, dy = x - links.at[k, 0], y - links.at[k, 1]
        moved = math.sqrt(dx * dx + dy * dy)
        d2 = gate2
        if m >= 0:
            dx, dy = x - buckets.points[m, 0], y - buckets.points[m, 1]
            d2 = dx * dx + dy * dy
        if not math.sqrt(d2) + moved < links.second[k]:
            m, d2, second = nearest(buckets, x, y, reach, m)
            links.nearest_of[k], links.second[k] = m, math.sqrt(second)
            links.at[k, 0], links.at[k, 1] = x, y
        if m >= 0 and d2 <= gate2 and (links.partner[m] < 0 or d2 < links.d2[m]):
            links.partner[m] = k
            links.d2[m] = d2


@njit(inner=True)
def closed_form(
    model: Floats, scene: Floats, partner: Ints, count: int
) -> tuple[int, tuple[float, float, float]]:
    """Rigid motion (x, y, theta) of least squared pair distance. Original code: closed form 2D."""
    pairs = 0
    mx, my, sx, sy = 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        if partner[k] >= 0:
            pairs += 1
            mx, my = mx + model[k, 0], my + model[k, 1]
            sx, sy = sx + scene[partner[k], 0], sy + scene[partner[k], 1]
    if pairs <= 2:
        return pairs, (0.0, 0.0, 0.0)
    mx, my, sx, sy = mx / pairs, my / pairs, sx / pairs, sy / pairs
    cross, dot = 0.0, 0.0
    for k in range(count):
        if partner[k] >= 0:
            ax, ay = model[k, 0] - mx, model[k, 1] - my
            bx, by = scene[partner[k], 0] - sx, scene[partner[k], 1] - sy
            cross += ay * bx - ax * by
            dot += ax * bx + ay * by
    theta = math.atan2(cross, dot)
    c, s = math.cos(theta), math.sin(theta)
    return pairs, (mx - (c * sx - s * sy), my - (s * sx + c * sy), theta)


@njit
def move(points: Floats, count: int, x: float, y: float, theta: float) -> None:
    """Move points in place by (x, y, theta). ours."""
    c, s = math.cos(theta), math.sin(theta)
    for k in range(count):
        px, py = points[k, 0], points[k, 1]
        points[k, 0] = x + c * px - s * py
        points[k, 1] = y + s * px + c * py


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

    Original code: ICP; the gate shrinks by a ratio meant for distances but applied to squares.
    Returns the pairs of the last round.
    """
    gate2, floor = gate.widest * gate.widest, gate.narrowest * gate.narrowest
    ratio = (gate.narrowest / gate.widest) ** (1.0 / max(gate.iterations - 11, 1))
    pairs = 0
    for k in range(n_scene):
        links.nearest_of[k], links.second[k] = -1, -1.0
    for _ in range(gate.iterations):
        pair_up(buckets, scene, n_scene, gate2, links)
        pairs, (dx, dy, turn) = closed_form(buckets.points, scene, links.partner, n_model)
        if pairs <= 2:
            break
        move(scene, n_scene, dx, dy, turn)
        c, s = math.cos(turn), math.sin(turn)
        x, y = out_motion[0], out_motion[1]
        out_motion[0] = dx + c * x - s * y
        out_motion[1] = dy + s * x + c * y
        out_motion[2] += turn
        gate2 = max(gate2 * ratio, floor)
    return pairs
