"""How much a scan tells about its pose, beam by beam, where all walls are squares of a grid."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats

ROUNDING = 1e-7  # cell
GRAZING = 1e-6  # cosine of the incidence below which a hit may be rounding


class Squares(NamedTuple):
    """Cells (ny, nx) that stop a ray, their edge [m], the outer corner of cell [0, 0] [m]."""

    occupied: NDArray[np.bool_]
    resolution: float
    x: float
    y: float


@njit(inner=True)
def _is_face(occupied: NDArray[np.bool_], i: int, wall: int, before: int, upright: bool) -> bool:
    """Whether the face between two columns (upright) or rows of cells goes on at place i.

    ours: the cell in the `wall` line is occupied, the one in the line `before` it is not.
    """
    across, along = occupied.shape[1], occupied.shape[0]
    if not upright:
        across, along = along, across
    if not (0 <= i < along and 0 <= wall < across):
        return False
    covered = 0 <= before < across
    if upright:
        return occupied[i, wall] and not (covered and occupied[i, before])
    return occupied[wall, i] and not (covered and occupied[before, i])


@njit(inner=True)
def _stays(
    occupied: NDArray[np.bool_], hx: float, hy: float, slack: float, upright: bool, way: int
) -> bool:
    """Whether the flat face hit at (hx, hy) [cell] goes on for `slack` [cell] to both sides.

    ours: cell by cell. `upright`: a face x = const; `way` the ray goes through it, 1 or -1.
    """
    border = round(hx if upright else hy)
    place = hy if upright else hx
    wall = border if way > 0 else border - 1
    for i in range(math.floor(place - slack), math.floor(place + slack) + 1):
        if not _is_face(occupied, i, wall, wall - way, upright):
            return False
    return True


@njit(inner=True)
def _is_upright(occupied: NDArray[np.bool_], hx: float, hy: float, c: float) -> bool:
    """Whether a ray with direction cosine c meets a face x = const at (hx, hy) [cell].

    ours: a hit lies on the border of two columns or of two rows; on both where two cells of a flat
    wall join.
    """
    off_x, off_y = abs(hx - round(hx)), abs(hy - round(hy))
    if max(off_x, off_y) > ROUNDING:
        return off_x < off_y
    return _stays(occupied, hx, hy, 2.0 * ROUNDING, True, 1 if c > 0.0 else -1)


@njit
def fisher_information(
    squares: Squares,
    rays: Floats,
    distances: Floats,
    weights: Floats,
    bases: Floats,
    covariances: Floats,
    out: Floats,
    out_beams: NDArray[np.int64],
) -> None:
    """Information out (n, 3, 3) of scans about the poses (n, 3) of the base [Censi07].

    The sum of g g' / sigma^2 over the beams, g the gradient of a range by x, y, theta of the base:
    with the ray's direction phi and a face x = const, r = (face - x) / cos(phi). rays (n, b, 3)
    x, y, phi; distances (n, b) [m] to the squares; weights (n, b) 1 / sigma^2 [1/m^2], 0 = not
    counted. A beam counts, out_beams (n,), when its hit stays on its flat face for one standard
    deviation of the pose, covariances (n, 3, 3), to both sides. All rays of a scan keep their place
    in the base while it moves.
    """
    scale = 1.0 / squares.resolution
    for k in range(len(rays)):
        for i in range(rays.shape[1]):
            weight, r = weights[k, i], distances[k, i]
            if weight <= 0.0:
                continue
            x, y = rays[k, i, 0], rays[k, i, 1]
            c, s = math.cos(rays[k, i, 2]), math.sin(rays[k, i, 2])
            hx, hy = (x + r * c - squares.x) * scale, (y + r * s - squares.y) * scale
            upright = _is_upright(squares.occupied, hx, hy, c)
            through = c if upright else s
            if abs(through) < GRAZING:
                continue
            # gradients of the range and of the hit's place along the face by x, y, phi
            if upright:
                gx, gy, g_phi = -1.0 / c, 0.0, r * s / c
                qx, qy, q_phi = -s / c, 1.0, r / c
            else:
                gx, gy, g_phi = 0.0, -1.0 / s, -r * c / s
                qx, qy, q_phi = 1.0, -c / s, -r / s
            # turning the base also moves the ray's start
            lever_x, lever_y = bases[k, 1] - y, x - bases[k, 0]
            g = (gx, gy, g_phi + gx * lever_x + gy * lever_y)
            q = (qx, qy, q_phi + qx * lever_x + qy * lever_y)
            variance = 0.0
            for a in range(3):
                for b in range(3):
                    variance += q[a] * covariances[k, a, b] * q[b]
            slack = scale * math.sqrt(max(variance, 0.0))
            way = 1 if through > 0.0 else -1
            if slack > 0.0 and not _stays(squares.occupied, hx, hy, slack, upright, way):
                continue
            out_beams[k] += 1
            for a in range(3):
                for b in range(3):
                    out[k, a, b] += weight * g[a] * g[b]
