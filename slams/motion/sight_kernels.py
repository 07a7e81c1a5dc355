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
            out[m] = error / math.sqrt(a**-4 + c**-4 + twice * twice * b**-4)
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
    x0 = y0 = hits = 0.0
    extent = max(PIECE, PIECE_NOISE * noise)
    for i in range(0, n, every):
        r = float(ranges[i])
        if not 0.0 < r < far:
            continue
        hits += 1.0
        x, y = r * directions[i, 0], r * directions[i, 1]
        if count == 0 or (x - x0) ** 2 + (y - y0) ** 2 > extent * extent:
            x0, y0 = x, y
            pieces[count] = 0.0
            count += 1
        piece = pieces[count - 1]
        piece[0], piece[1], piece[2] = piece[0] + x, piece[1] + y, piece[2] + 1.0
    for i in range(count):
        pieces[i, 0] /= pieces[i, 2]
        pieces[i, 1] /= pieces[i, 2]
    out[:] = 0.0
    out[4] = hits
    for i in range(1, count - 1):
        before, piece, after = pieces[i - 1], pieces[i], pieces[i + 1]
        dx, dy = after[0] - before[0], after[1] - before[1]
        way = math.sqrt(dx * dx + dy * dy)
        if way == 0.0:
            continue
        tx, ty = dx / way, dy / way
        ax, ay, m = piece[0] - before[0], piece[1] - before[1], piece[2]
        along, bend = ax * tx + ay * ty, abs(ax * ty - ay * tx)
        if not 0.0 < along < way:
            continue
        share = along / way
        spread = 1.0 / m + (1.0 - share) ** 2 / before[2] + share * share / after[2]
        straight = STRAIGHT * noise * math.sqrt(spread) + BULGE * min(along, way - along) + ROUGH
        if bend < straight:
            tilt = noise * noise * (1.0 / before[2] + 1.0 / after[2]) / (way * way)
            out[0] += m * (ty * ty - tilt * tx * tx)
            out[1] -= m * (1.0 + tilt) * tx * ty
            out[2] += m * (tx * tx - tilt * ty * ty)
            out[3] += m
        elif max(along, way - along) < NEAR * extent:
            out[0] += CLUTTER * m
            out[2] += CLUTTER * m
            out[3] += m
