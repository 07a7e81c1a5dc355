"""From ranges to points, and from points to small pieces of surface."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.jit import njit
from slams.types import Floats, Ranges


class Beams(NamedTuple):
    """How the ranges of one scan lie in the base frame.

    Mount x, y [m], theta [rad]; the motion x, y [m], theta [rad] of the base from one beam to the
    next; angle between two beams [rad]; least and greatest range used [m].
    """

    x: float
    y: float
    theta: float
    sweep_x: float
    sweep_y: float
    sweep_theta: float
    increment: float
    near: float
    far: float


class Walls(NamedTuple):
    """What counts as a piece of wall.

    `reach` [m] from a point to the neighbors its normal is fitted to; `flatness` [m] greatest
    deviation of the neighbors from their line; `ratio` greatest deviation over length, squared;
    `grazing` least cosine between beam and normal.
    """

    reach: float
    flatness: float
    ratio: float
    grazing: float


NEIGHBORS = 2  # beams on either side that are neighbors at any distance
GAP = 10.0  # a wall is followed to an incidence at which neighbors lie this many beam widths apart


@njit
def end_points(ranges: Ranges, directions: Floats, beams: Beams, out: Floats) -> int:
    """End points [m] of the beams with a return, in the base frame of the first beam.

    ours: every beam is moved by the way the base went since the first one. ranges (n,) m,
    directions (n, 2), out (>= n, 2); returns how many rows were written.
    """
    c, s = math.cos(beams.theta), math.sin(beams.theta)
    n = 0
    for i in range(min(ranges.shape[0], directions.shape[0])):
        r = ranges[i]
        if not (r >= beams.near and r < beams.far):
            continue
        lx, ly = r * directions[i, 0], r * directions[i, 1]
        x, y = beams.x + c * lx - s * ly, beams.y + s * lx + c * ly
        if beams.sweep_theta != 0.0 or beams.sweep_x != 0.0 or beams.sweep_y != 0.0:
            ct, st = math.cos(i * beams.sweep_theta), math.sin(i * beams.sweep_theta)
            x, y = ct * x - st * y + i * beams.sweep_x, st * x + ct * y + i * beams.sweep_y
        out[n, 0], out[n, 1] = x, y
        n += 1
    return n


@njit
def surfaces(points: Floats, beams: Beams, walls: Walls, out: Floats) -> int:
    """Points with the normal of the wall they lie on, facing the laser.

    ours: the normal is the direction of least variance among the neighbors along the scan within
    reach, at least two beams to either side; sums slide along the scan. A point that lies on
    nothing flat looks at the laser; one on a wall seen edge-on is left out. points (n, 2); out
    (>= n, 4) rows x, y [m], nx, ny; returns how many.
    """
    n_points = points.shape[0]
    near = walls.reach * walls.reach
    first, last, n = 0, -1, 0
    sx = sy = sxx = sxy = syy = 0.0
    for i in range(n_points):
        px, py = points[i, 0], points[i, 1]
        ux, uy = beams.x - px, beams.y - py
        away = math.hypot(ux, uy)
        if last < i:  # the wall ended before this point
            first, last = i, i
            sx, sy, sxx, sxy, syy = px, py, px * px, px * py, py * py
        widest = max(walls.reach, GAP * away * beams.increment) ** 2
        while last + 1 < n_points:
            x, y = points[last + 1, 0], points[last + 1, 1]
            if (x - points[last, 0]) ** 2 + (y - points[last, 1]) ** 2 > widest:
                break
            if last + 1 - i > NEIGHBORS and (x - px) ** 2 + (y - py) ** 2 > near:
                break
            last += 1
            sx, sy = sx + x, sy + y
            sxx, sxy, syy = sxx + x * x, sxy + x * y, syy + y * y
        while i - first > NEIGHBORS:
            x, y = points[first, 0], points[first, 1]
            if (x - px) ** 2 + (y - py) ** 2 <= near:
                break
            first += 1
            sx, sy = sx - x, sy - y
            sxx, sxy, syy = sxx - x * x, sxy - x * y, syy - y * y
        if away <= 0.0:
            continue
        nx, ny = ux / away, uy / away
        count = last - first + 1
        if count > NEIGHBORS:
            vxx = sxx / count - (sx / count) ** 2
            vyy = syy / count - (sy / count) ** 2
            vxy = sxy / count - sx * sy / (count * count)
            spread = math.sqrt((0.5 * (vxx - vyy)) ** 2 + vxy * vxy)
            mean = 0.5 * (vxx + vyy)
            thickness = mean - spread
            if thickness <= min(walls.ratio * (mean + spread), walls.flatness * walls.flatness):
                along = 0.5 * math.atan2(2.0 * vxy, vxx - vyy)
                wx, wy = -math.sin(along), math.cos(along)
                cosine = wx * nx + wy * ny
                if abs(cosine) < walls.grazing:
                    continue
                nx, ny = (wx, wy) if cosine > 0.0 else (-wx, -wy)
        out[n, 0], out[n, 1], out[n, 2], out[n, 3] = px, py, nx, ny
        n += 1
    return n
