"""From ranges to points, and from points to small pieces of surface."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.jit import njit
from slams.types import Floats, Ranges


class Beams(NamedTuple):
    """How the ranges of one scan lie in the base frame.

    Mount x, y [m], theta [rad]; the motion x, y [m], theta [rad] of the base from one beam to the
    next; angle between two beams [rad]; least and greatest range used [m]; within how many meters
    beams are averaged.
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
    grain: float


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


NEIGHBORS = 2  # points on either side that are neighbors at any distance
GAP = 10.0  # a wall is followed to an incidence at which neighbors lie this many beam widths apart


@njit
def end_points(ranges: Ranges, directions: Floats, beams: Beams, out: Floats) -> int:
    """End points [m] of the beams with a return, in the base frame of the first beam.

    ours: every beam is moved by the way the base went since the first one; beams that end close
    together become their mean. ranges (n,) m, directions (n, 2), out (>= n, 3) x, y, how many
    beams; returns how many rows were written.
    """
    c, s = math.cos(beams.theta), math.sin(beams.theta)
    n, first_x, first_y = 0, 0.0, 0.0
    for i in range(min(ranges.shape[0], directions.shape[0])):
        r = ranges[i]
        if not (r >= beams.near and r < beams.far):
            continue
        lx, ly = r * directions[i, 0], r * directions[i, 1]
        x, y = beams.x + c * lx - s * ly, beams.y + s * lx + c * ly
        if beams.sweep_theta != 0.0 or beams.sweep_x != 0.0 or beams.sweep_y != 0.0:
            ct, st = math.cos(i * beams.sweep_theta), math.sin(i * beams.sweep_theta)
            x, y = ct * x - st * y + i * beams.sweep_x, st * x + ct * y + i * beams.sweep_y
        if n == 0 or math.hypot(x - first_x, y - first_y) >= beams.grain:
            first_x, first_y = x, y
            out[n, 0] = out[n, 1] = out[n, 2] = 0.0
            n += 1
        out[n - 1, 2] += 1.0
        out[n - 1, 0] += (x - out[n - 1, 0]) / out[n - 1, 2]
        out[n - 1, 1] += (y - out[n - 1, 1]) / out[n - 1, 2]
    return n


@njit
def surfaces(points: Floats, beams: Beams, walls: Walls, out: Floats) -> int:
    """Points with the normal of the wall they lie on, facing the laser.

    ours: the normal is the direction of least variance among the neighbors along the scan within
    reach, at least two to either side. A point that lies on nothing flat looks at the laser; one
    on a wall seen edge-on is left out. points (n, 3) of `end_points`; out (>= n, 5) rows x, y [m],
    nx, ny, how many beams; returns how many.
    """
    n = 0
    for i in range(points.shape[0]):
        px, py = points[i, 0], points[i, 1]
        away = math.hypot(beams.x - px, beams.y - py)
        if away <= 0.0:
            continue
        widest = max(walls.reach, GAP * away * beams.increment)
        count, w, sx, sy, sxx, sxy, syy = 1, points[i, 2], 0.0, 0.0, 0.0, 0.0, 0.0
        for side in (-1, 1):
            j, last_x, last_y = i + side, 0.0, 0.0
            while 0 <= j < points.shape[0]:
                x, y, m = points[j, 0] - px, points[j, 1] - py, points[j, 2]
                if math.hypot(x - last_x, y - last_y) > widest:
                    break
                if abs(j - i) > NEIGHBORS and math.hypot(x, y) > walls.reach:
                    break
                count, w, sx, sy = count + 1, w + m, sx + m * x, sy + m * y
                sxx, sxy, syy = sxx + m * x * x, sxy + m * x * y, syy + m * y * y
                last_x, last_y = x, y
                j += side
        nx, ny = (beams.x - px) / away, (beams.y - py) / away
        vxx, vxy, vyy = sxx - sx * sx / w, sxy - sx * sy / w, syy - sy * sy / w
        spread = math.hypot(0.5 * (vxx - vyy), vxy) / w
        mean = 0.5 * (vxx + vyy) / w
        flatness = walls.flatness * walls.flatness
        flat = mean - spread <= min(walls.ratio * (mean + spread), flatness)
        if flat and count > NEIGHBORS:
            along = 0.5 * math.atan2(2.0 * vxy, vxx - vyy)
            wx, wy = -math.sin(along), math.cos(along)
            cosine = wx * nx + wy * ny
            if abs(cosine) < walls.grazing:
                continue
            nx, ny = (wx, wy) if cosine > 0.0 else (-wx, -wy)
        out[n, 0], out[n, 1], out[n, 2], out[n, 3], out[n, 4] = px, py, nx, ny, points[i, 2]
        n += 1
    return n
