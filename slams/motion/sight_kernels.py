"""Kernels of sight: a scan's own noise, and which way the walls face that it sees."""

from __future__ import annotations

import math

import numpy as np

from slams.jit import njit
from slams.types import Floats, Ranges

PIECE, PIECE_NOISE = 0.1, 8.0  # m, and deviations: extent of a piece of wall
STRAIGHT, BULGE, ROUGH = 4.0, 0.02, 0.003  # deviations, share of a piece's way, m: bend of a wall
NEAR = 3.0  # pieces within which what is bent is a thing, not two walls
CLUTTER = 0.25  # of a beam is told of each direction by one on such a thing
N_FACES = 5
ONE = np.float32(1.0)  # as precise as ranges are


@njit(borrows=True)
def hits(ranges: Ranges, far: float, most: int) -> int:
    """Number of ranges (n,) that met something nearer than `far` [m]; at `most` it ends. ours."""
    met = 0
    for i in range(len(ranges)):
        met += ranges[i] < far
        if met >= most:
            break
    return met


@njit
def bends(ranges: Ranges, every: int, turn: float, far: float, out: Floats) -> int:
    """How far beams are from being on one straight wall with those beside them, in ranges [m].

    ours: along a straight wall 1/r is a sine of the angle, so of three beams in a row the outer two
    foretell the middle one, near or far, at any spacing. Every so many of the ranges (n,) are used,
    `turn` [rad] apart; out (>= n / every,), as deviations of a range; returns how many.
    """
    m, twice = 0, 2.0 * math.cos(turn)
    for i in range(every, len(ranges) - every, every):
        a, b, c = float(ranges[i - every]), float(ranges[i]), float(ranges[i + every])
        if 0.0 < a < far and 0.0 < b < far and 0.0 < c < far:
            error = abs(1.0 / a + 1.0 / c - twice / b)
            aa, bb, cc = a * a, b * b, c * c
            spread = ONE / (aa * aa) + ONE / (cc * cc) + twice * twice * (ONE / (bb * bb))
            out[m] = error / math.sqrt(spread)
            m += 1
    return m


@njit
def faces(
    ranges: Ranges, directions: Floats, every: int, far: float, noise: float, out: Floats
) -> None:
    """Sum over the beams of n n^T, n being the normals of the walls that are met.

    ours: beams are gathered to pieces of wall larger than their noise; a piece in line with those
    beside it has their chord's normal, and what noise turns that by is taken off. out (N_FACES,):
    xx, xy, yy in the laser's frame, how many beams told of it, and how many met something;
    directions (n, 2).
    """
    n, count = len(ranges), 0
    pieces = np.empty((n // every + 1, 3))
    x0 = y0 = sx = sy = m = hits = told = xx = xy = yy = 0.0
    extent = max(PIECE, PIECE_NOISE * noise)
    for i in range(0, n, every):
        r = float(ranges[i])
        if not 0.0 < r < far:
            continue
        hits += 1.0
        x, y = r * directions[i, 0], r * directions[i, 1]
        dx, dy = x - x0, y - y0
        if count == 0 or dx * dx + dy * dy > extent * extent:
            x0, y0 = x, y
            sx = sy = m = 0.0
            count += 1
        sx, sy, m = sx + x, sy + y, m + 1.0
        k = count - 1
        pieces[k, 0], pieces[k, 1], pieces[k, 2] = sx / m, sy / m, m
    for i in range(1, count - 1):
        x0, y0, before = pieces[i - 1, 0], pieces[i - 1, 1], pieces[i - 1, 2]
        dx, dy, after = pieces[i + 1, 0] - x0, pieces[i + 1, 1] - y0, pieces[i + 1, 2]
        way = math.sqrt(dx * dx + dy * dy)
        if way == 0.0:
            continue
        tx, ty = dx / way, dy / way
        ax, ay, m = pieces[i, 0] - x0, pieces[i, 1] - y0, pieces[i, 2]
        along, bend = ax * tx + ay * ty, abs(ax * ty - ay * tx)
        if not 0.0 < along < way:
            continue
        share, rest = along / way, 1.0 - along / way
        spread = 1.0 / m + rest * rest / before + share * share / after
        straight = STRAIGHT * noise * math.sqrt(spread) + BULGE * min(along, way - along) + ROUGH
        if bend < straight:
            tilt = noise * noise * (1.0 / before + 1.0 / after) / (way * way)
            xx += m * (ty * ty - tilt * tx * tx)
            xy -= m * (1.0 + tilt) * tx * ty
            yy += m * (tx * tx - tilt * ty * ty)
            told += m
        elif max(along, way - along) < NEAR * extent:
            xx += CLUTTER * m
            yy += CLUTTER * m
            told += m
    out[0], out[1], out[2], out[3], out[4] = xx, xy, yy, told, hits
