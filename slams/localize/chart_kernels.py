"""Kernels that look around in a chart: what a beam meets, and how a scan fits at a pose."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.geometry import solve3
from slams.jit import njit
from slams.types import Floats

EXPLAINED, OPEN, REFUTED, UNKNOWN = 1, 0, -1, 2  # what a map says of a beam
NOTHING = -1.0  # range of a beam that meets no wall the map knows of
TURN = 0.05  # rad, most of one step of the fit; its most way is the distance that halves a weight
STILL, STILL_TURN = 0.01, 1e-4  # cell, rad: a step below these is the last of a fit
CREEP = 0.5  # cells to go on next to what is not free: no wall is thinner


class Cells(NamedTuple):
    """A map as arrays (ny, nx), in cells; cell [iy, ix] covers ix <= x < ix + 1.

    `gap` Chebyshev distance to the nearest cell that is not free, 0 inside; `wall` whether the cell
    or a neighbor is occupied; `distance` [cell] to the nearest occupied cell, cut off.
    """

    gap: NDArray[np.uint8]
    wall: NDArray[np.bool_]
    distance: NDArray[np.float32]


class Tolerance(NamedTuple):
    """When a beam agrees: end to wall, and way through what is not free before it [cell]."""

    end: float
    way: float


@njit(inner=True, borrows=True)
def cast(cells: Cells, x: float, y: float, c: float, s: float, far: float) -> float:
    """Range [cell] at which a beam from (x, y) along (c, s) meets a wall, at most `far`.

    ours: leaps by the gap; `NOTHING` where it ends in cells that nobody has seen, or meets nothing.
    """
    ny, nx = cells.gap.shape
    r = 0.0
    while r < far:
        fx, fy = x + r * c, y + r * s
        if not (fx >= 0.0 and fy >= 0.0 and fx < nx and fy < ny):
            return NOTHING
        ix, iy = math.floor(fx), math.floor(fy)
        gap = cells.gap[iy, ix]
        if gap == 0:
            return r if cells.wall[iy, ix] else NOTHING
        r += max(gap - 1.0, CREEP)
    return NOTHING


@njit
def look_around(
    cells: Cells, places: Floats, far: float, scale: float, out_ranges: NDArray[np.uint16]
) -> None:
    """Ranges seen from places (n, 2) [cell] in all directions, times `scale`; 0 where none.

    ours: out_ranges (n, turns), direction k is 2 pi k / turns.
    """
    n, turns = out_ranges.shape
    for i in range(n):
        for k in range(turns):
            angle = 2.0 * math.pi * k / turns
            r = cast(cells, places[i, 0], places[i, 1], math.cos(angle), math.sin(angle), far)
            out_ranges[i, k] = np.uint16(max(r, 0.0) * scale)


@njit
def compare(
    seen: NDArray[np.uint16],
    directions: NDArray[np.int64],
    ranges: NDArray[np.int32],
    tolerances: NDArray[np.int32],
    out_best: NDArray[np.int32],
    out_turn: NDArray[np.int32],
) -> None:
    """How many beams of a scan agree with each place, at the heading where most do.

    ours: beam by beam for all headings at once. seen (n, turns) in the unit of `ranges` (m,);
    directions (m,) the beams' in turns; out_best, out_turn (n,).
    """
    n, turns = seen.shape
    agree = np.zeros(turns, np.int32)
    twice = np.zeros(2 * turns, np.int32)
    for i in range(n):
        for k in range(turns):
            twice[k] = twice[k + turns] = seen[i, k]
            agree[k] = 0
        for j in range(len(ranges)):
            part, r, tolerance = twice[directions[j] :], ranges[j], tolerances[j]
            for k in range(turns):
                agree[k] += 1 if abs(part[k] - r) < tolerance else 0
        best = 0
        for k in range(turns):
            if agree[k] > agree[best]:
                best = k
        out_best[i], out_turn[i] = agree[best], best


@njit
def fit(cells: Cells, points: Floats, softs: Floats, steps: int, pose: Floats) -> None:
    """Move a pose x, y [cell], theta so that points (n, 2) [cell] lie on walls, round by round.

    ours: a round for each of `softs` [cell], from far walls to near ones.
    """
    room = np.empty((5, 3))
    for soft in softs:
        one_round(cells, points, soft, steps, pose, room)


@njit(inner=True, borrows=True)
def one_round(
    cells: Cells, points: Floats, soft: float, steps: int, pose: Floats, room: Floats
) -> None:
    """Move a pose x, y [cell], theta so that points (n, 2) [cell] lie on walls.

    ours: Gauss-Newton on the distance to the nearest wall, a point's weight halved at `soft`; at
    most so many `steps`. room (5, 3).
    """
    ny, nx = cells.distance.shape
    H, b, step = room, room[3], room[4]
    for _ in range(steps):
        c, s = math.cos(pose[2]), math.sin(pose[2])
        hxx = hxy = hyy = hxt = hyt = htt = bx = by = bt = 0.0
        for i in range(len(points)):
            qx, qy = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
            x, y = pose[0] + qx - 0.5, pose[1] + qy - 0.5
            if not (x >= 0.0 and y >= 0.0 and x < nx - 1 and y < ny - 1):
                continue
            ix, iy = math.floor(x), math.floor(y)
            fx, fy = x - ix, y - iy
            d00, d10 = cells.distance[iy, ix], cells.distance[iy, ix + 1]
            d01, d11 = cells.distance[iy + 1, ix], cells.distance[iy + 1, ix + 1]
            low, high = d00 + fx * (d10 - d00), d01 + fx * (d11 - d01)
            e = low + fy * (high - low)
            gx = (1.0 - fy) * (d10 - d00) + fy * (d11 - d01)
            gy = (1.0 - fx) * (d01 - d00) + fx * (d11 - d10)
            gt = gy * qx - gx * qy
            share = e / soft
            w = 1.0 / (1.0 + share * share)
            w *= w
            hxx += w * gx * gx
            hxy += w * gx * gy
            hyy += w * gy * gy
            hxt += w * gx * gt
            hyt += w * gy * gt
            htt += w * gt * gt
            bx -= w * e * gx
            by -= w * e * gy
            bt -= w * e * gt
        H[0, 0], H[1, 1], H[2, 2] = 1.01 * hxx, 1.01 * hyy, 1.01 * htt
        H[0, 1] = H[1, 0] = hxy
        H[0, 2] = H[2, 0] = hxt
        H[1, 2] = H[2, 1] = hyt
        b[0], b[1], b[2] = bx, by, bt
        if not solve3(H, b, step):
            return
        for j in range(3):
            most = TURN if j == 2 else soft
            pose[j] += max(-most, min(most, step[j]))
        if max(abs(step[0]), abs(step[1])) < STILL and abs(step[2]) < STILL_TURN:
            return


@njit
def judge(
    cells: Cells, points: Floats, pose: Floats, tolerance: Tolerance, out: NDArray[np.int8]
) -> None:
    """What a map says of beams that end in points (n, 2) [cell].

    ours: explained is an end at a wall that is seen from `pose`; refuted a beam that goes through a
    wall. Somebody may stand in the way of one that ends in the open; of the rest nothing is known.
    out (n,).
    """
    ny, nx = cells.gap.shape
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for i in range(len(points)):
        out[i] = UNKNOWN
        qx, qy = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
        r = math.sqrt(qx * qx + qy * qy)
        if r < 1.0:
            continue
        free = cast(cells, pose[0], pose[1], qx / r, qy / r, r)
        if free >= 0.0 and free < r - tolerance.way:
            out[i] = REFUTED
            continue
        x, y = pose[0] + qx, pose[1] + qy
        if not (x >= 0.0 and y >= 0.0 and x < nx and y < ny):
            continue
        ix, iy = math.floor(x), math.floor(y)
        if cells.distance[iy, ix] <= tolerance.end:
            out[i] = EXPLAINED
        elif cells.gap[iy, ix] > 0:
            out[i] = OPEN


@njit
def measure(cells: Cells, pose: Floats, angles: Floats, far: float, out_ranges: Floats) -> None:
    """Ranges [cell] of beams from a pose x, y [cell], theta; `NOTHING` where there is no wall.

    ours: a wall is somewhere in its cell, so it counts as in the middle: the beam ends where it is
    nearest to the center of the first occupied cell, `far` at most.
    """
    for k in range(len(angles)):
        angle = pose[2] + angles[k]
        c, s = math.cos(angle), math.sin(angle)
        r = cast(cells, pose[0], pose[1], c, s, far)
        out_ranges[k] = NOTHING
        while r >= 0.0 and r < far:
            x, y = math.floor(pose[0] + r * c), math.floor(pose[1] + r * s)
            ny, nx = cells.wall.shape
            if not (x >= 0 and y >= 0 and x < nx and y < ny and cells.wall[y, x]):
                break
            if cells.distance[y, x] == 0.0:
                out_ranges[k] = (x + 0.5 - pose[0]) * c + (y + 0.5 - pose[1]) * s
                break
            r += CREEP
