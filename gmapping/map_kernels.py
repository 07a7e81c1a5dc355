"""A map of signed distances to surfaces, and what a scan writes into it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gmapping.tile_kernels import BITS, Tiles, cell_of, inside_tile, own_slot
from slams.jit import njit
from slams.types import Floats

LAYERS = 4
DEPTH = 5  # numbers of a cell: as few as will do, as memory is what takes the time of `write`
BRIDGE = 0.3  # m that a wall is continued to either side of a point, at most
FRONTAL = 0.5  # cosine between beam and normal of a wall that is not seen edge-on
IN_LINE, ALIKE = 0.2, 0.9  # sine of a way along a wall, and cosine between normals on it
ONCE = 0.2  # trust in a surface that one scan alone has seen


class Splat(NamedTuple):
    """How points enter: `band` cells on either side of a surface, `cap` on a cell's weight.

    `driven` [m] is the way so far, a little more at every scan that enters; x, y [m] where in the
    base frame the laser is.
    """

    band: int
    cap: float
    driven: float
    x: float = 0.0
    y: float = 0.0


@njit(inner=True, borrows=True)
def facing(tiles: Tiles, nx: float, ny: float) -> int:
    """Layer of a surface by the side its normal points to: 0 the axis, 1 left of it, 2, 3. ours."""
    ahead, left = tiles.axis_x * nx + tiles.axis_y * ny, tiles.axis_x * ny - tiles.axis_y * nx
    if abs(ahead) >= abs(left):
        return 0 if ahead >= 0.0 else 2
    return 1 if left >= 0.0 else 3


@njit(inner=True, borrows=True)
def trust(seen: float) -> float:
    """How far a surface is believed: one that one scan alone has seen may have been a leg.

    ours. `seen` as a cell keeps it: the way [m] at which it was first, less than 0 if since again.
    """
    return ONCE if seen > 0.0 else 1.0


@njit(inner=True, borrows=True)
def is_old(seen: float, old: float) -> bool:
    """Whether a surface was first seen before the way `old` [m]; `seen` as in `trust`. ours."""
    return abs(seen) < old


@njit(inner=True, borrows=True)
def bridged(surface: Floats, i: int, splat: Splat) -> float:
    """Half of the way [m] from a point to the next one beside it on its wall; 0 without any.

    ours: where beams are far apart, a wall is straight between those that are in line with it. Not
    so of one seen edge-on, on which all beams are far apart.
    """
    x, y, nx, ny = surface[i, 0], surface[i, 1], surface[i, 2], surface[i, 3]
    bx, by, most = x - splat.x, y - splat.y, 0.0
    if (nx * bx + ny * by) ** 2 < FRONTAL * FRONTAL * (bx * bx + by * by):
        return 0.0
    for j in (i - 1, i + 1):
        if 0 <= j < surface.shape[0]:
            dx, dy = surface[j, 0] - x, surface[j, 1] - y
            square, off = dx * dx + dy * dy, nx * dx + ny * dy
            in_line = off * off < IN_LINE * IN_LINE * square
            if in_line and surface[j, 2] * nx + surface[j, 3] * ny > ALIKE:
                most = max(most, square)
    return min(0.5 * math.sqrt(most), BRIDGE)


@njit(inner=True, borrows=True)
def place_of(layer: int, ix: int, iy: int) -> int:
    """Place of a cell in its tile: those along a wall, not those across, lie side by side. ours."""
    return inside_tile(ix, iy) if layer & 1 else inside_tile(iy, ix)


@njit
def insert(tiles: Tiles, poses: Floats, surface: Floats, splat: Splat) -> int:
    """Average the line through every point into the cells around it, in every particle's map.

    ours: poses (particles, 3) m, rad; surface (n, 5) x, y [m], nx, ny in the base frame, beams;
    returns how many cells had no room.
    """
    edge = tiles.resolution
    lacking, alongs = 0, np.empty(surface.shape[0])
    for i in range(surface.shape[0]):
        alongs[i] = max(1.5 * edge, bridged(surface, i, splat) + 0.5 * edge)
    for particle in range(poses.shape[0]):
        lacking += write(tiles, particle, poses[particle], surface, alongs, splat)
    return lacking


@njit(inner=True, borrows=True)
def write(
    tiles: Tiles, particle: int, pose: Floats, surface: Floats, alongs: Floats, splat: Splat
) -> int:
    """Average the lines through the points of a scan into one particle's map.

    ours: a cell keeps the means over lines of the signed distance d = n . (cell - point) and of
    the normal n, so (d, n) is the mean line as seen from the cell's center, and the weight. A
    line counts less the farther along the wall its point lies, up to `alongs` (n,) [m]. Beside them
    the way at which the first scan saw it, less than 0 once another has. pose (3,) m, rad;
    `surface` as of `insert`; returns how many cells had no room.
    """
    edge, now = tiles.resolution, np.float32(splat.driven)  # as a cell keeps it
    reach, lacking = (splat.band + 0.5) * edge, 0
    c, s = math.cos(pose[2]), math.sin(pose[2])
    tu, tv, last, slot = 0, 0, -1, 0  # the tile written last
    for i in range(surface.shape[0]):
        x, y, nx, ny = surface[i, 0], surface[i, 1], surface[i, 2], surface[i, 3]
        px, py = pose[0] + c * x - s * y, pose[1] + s * x + c * y
        wx, wy = c * nx - s * ny, s * nx + c * ny
        layer, along = facing(tiles, wx, wy), alongs[i]
        level = layer & 1  # whether u, along the wall as well as an axis is, is x; v goes across
        u, v, wu, wv = (px, py, wx, wy) if level else (py, px, wy, wx)
        iu, iv = cell_of(u, edge), cell_of(v, edge)
        band = max(splat.band, math.ceil(along / edge))
        fade, wide = surface[i, 4] / along, along * abs(wv) + reach * abs(wu)
        first = max(iu - band, math.ceil((u - wide) / edge))
        end = min(iu + band, math.floor((u + wide) / edge)) + 1
        for ju in range(first, end):
            ou = ju * edge - u
            for jv in range(iv - band, iv + band + 1):
                ov = jv * edge - v
                distance = wu * ou + wv * ov
                weight = fade * (along - abs(wu * ov - wv * ou))
                if weight <= 0.0 or abs(distance) > reach:
                    continue
                if ju >> BITS != tu or jv >> BITS != tv or layer != last:
                    tu, tv, last = ju >> BITS, jv >> BITS, layer
                    jx, jy = (ju, jv) if level else (jv, ju)
                    slot = own_slot(tiles, particle, layer, jx, jy)
                if slot == 0:
                    lacking += 1
                    continue
                cell = tiles.cells[slot, inside_tile(ju, jv)]
                total = cell[3] + weight
                gain = weight / total
                cell[0] += gain * (distance - cell[0])
                cell[1] += gain * (wx - cell[1])
                cell[2] += gain * (wy - cell[2])
                cell[3] = min(total, splat.cap)
                if cell[4] == 0.0:
                    cell[4] = now
                elif cell[4] > 0.0 and cell[4] != now:
                    cell[4] = -cell[4]
    return lacking
