"""A map of signed distances to surfaces, and the kernels that insert a scan into it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gmapping.tile_kernels import TILE_BITS, Tiles, cell_of, index_in_tile, own_slot
from slams.jit import njit
from slams.types import Floats

N_SURFACE_LAYERS = 4
N_SURFACE_VALUES = 5  # of a cell; few, as access to memory dominates the time of `write`
MAX_WALL_EXTENSION = 0.3  # m to either side of a point
MIN_EXTENSION_COSINE = 0.5  # between beam and normal; a wall seen edge-on is not extended
MAX_SAME_WALL_SINE = 0.2  # between a wall and the line from one of its points to the next
MIN_SAME_WALL_COSINE = 0.9  # between the normals of two points on a wall
SINGLE_SCAN_SURFACE_WEIGHT = 0.2  # of a surface observed by one scan: it may have been a leg


class SurfaceUpdate(NamedTuple):
    """How points enter: `band` cells on either side of a surface, `cap` on a cell's weight.

    `path_length` [m] identifies the scan: it grows with each one that enters. `laser_x`, `laser_y`
    [m]: the laser in the base frame.
    """

    band: int
    cap: float
    path_length: float
    laser_x: float = 0.0
    laser_y: float = 0.0


@njit(inner=True, borrows=True)
def layer_of(tiles: Tiles, nx: float, ny: float) -> int:
    """Layer of a surface by the direction of its normal: 0 the axis, 1 left of it, 2, 3. ours."""
    along, left = tiles.axis_x * nx + tiles.axis_y * ny, tiles.axis_x * ny - tiles.axis_y * nx
    if abs(along) >= abs(left):
        return 0 if along >= 0.0 else 2
    return 1 if left >= 0.0 else 3


@njit(inner=True, borrows=True)
def confidence(first_seen: float) -> float:
    """Weight of a surface in a match: less if one scan alone observed it.

    ours. `first_seen` as a cell stores it: path length [m] of the first scan that observed the
    surface, negative once another scan has.
    """
    return SINGLE_SCAN_SURFACE_WEIGHT if first_seen > 0.0 else 1.0


@njit(inner=True, borrows=True)
def is_old(first_seen: float, path_length: float) -> bool:
    """Whether a surface was first observed before a path length [m]; as in `confidence`. ours."""
    return abs(first_seen) < path_length


@njit(inner=True, borrows=True)
def half_gap(surface: Floats, i: int, update: SurfaceUpdate) -> float:
    """Half of the distance [m] from a point to the next one on the same wall; 0 if there is none.

    ours: between distant beams a wall is straight if their points are in line. A wall seen edge-on
    is not extended: all beams on it are far apart.
    """
    x, y, nx, ny = surface[i, 0], surface[i, 1], surface[i, 2], surface[i, 3]
    bx, by, max_square = x - update.laser_x, y - update.laser_y, 0.0
    if (nx * bx + ny * by) ** 2 < MIN_EXTENSION_COSINE * MIN_EXTENSION_COSINE * (bx * bx + by * by):
        return 0.0
    for j in (i - 1, i + 1):
        if 0 <= j < surface.shape[0]:
            dx, dy = surface[j, 0] - x, surface[j, 1] - y
            square, across = dx * dx + dy * dy, nx * dx + ny * dy
            in_line = across * across < MAX_SAME_WALL_SINE * MAX_SAME_WALL_SINE * square
            if in_line and surface[j, 2] * nx + surface[j, 3] * ny > MIN_SAME_WALL_COSINE:
                max_square = max(max_square, square)
    return min(0.5 * math.sqrt(max_square), MAX_WALL_EXTENSION)


@njit(inner=True, borrows=True)
def index_in_layer(layer: int, ix: int, iy: int) -> int:
    """Index of a cell in its tile: cells along a wall lie side by side in memory. ours."""
    return index_in_tile(ix, iy) if layer & 1 else index_in_tile(iy, ix)


@njit
def insert(tiles: Tiles, poses: Floats, surface: Floats, update: SurfaceUpdate) -> int:
    """Average the line through every point into the cells around it, in every particle's map.

    ours: poses (particles, 3) m, rad; surface (n, 5) x, y [m], nx, ny in the base frame, beams;
    returns the number of cells without a free tile.
    """
    edge = tiles.resolution
    n_dropped, spans = 0, np.empty(surface.shape[0])
    for i in range(surface.shape[0]):
        spans[i] = max(1.5 * edge, half_gap(surface, i, update) + 0.5 * edge)
    for particle in range(poses.shape[0]):
        n_dropped += write(tiles, particle, poses[particle], surface, spans, update)
    return n_dropped


@njit(inner=True, borrows=True)
def write(
    tiles: Tiles, particle: int, pose: Floats, surface: Floats, spans: Floats, update: SurfaceUpdate
) -> int:
    """Average the lines through the points of a scan into one particle's map.

    ours: a cell stores the means over lines of the signed distance d = n . (cell - point) and of
    the normal n, which are the mean line in the frame of the cell's center, and the weight. The
    weight of a line falls with the distance of its point along the wall, to 0 at `spans` (n,)
    [m]. The last number is that of `confidence`. pose (3,) m, rad; `surface` as in `insert`;
    returns the number of cells without a free tile.
    """
    edge, now = tiles.resolution, np.float32(update.path_length)  # rounded as in a cell
    reach, n_dropped = (update.band + 0.5) * edge, 0
    c, s = math.cos(pose[2]), math.sin(pose[2])
    tu, tv, last, slot = 0, 0, -1, 0  # the tile of the last cell
    for i in range(surface.shape[0]):
        x, y, nx, ny = surface[i, 0], surface[i, 1], surface[i, 2], surface[i, 3]
        px, py = pose[0] + c * x - s * y, pose[1] + s * x + c * y
        wx, wy = c * nx - s * ny, s * nx + c * ny
        layer, span = layer_of(tiles, wx, wy), spans[i]
        u_is_x = layer & 1  # u is the axis of the grid that is nearest to the wall, v the other
        u, v, wu, wv = (px, py, wx, wy) if u_is_x else (py, px, wy, wx)
        iu, iv = cell_of(u, edge), cell_of(v, edge)
        band = max(update.band, math.ceil(span / edge))
        slope, half = surface[i, 4] / span, span * abs(wv) + reach * abs(wu)
        first = max(iu - band, math.ceil((u - half) / edge))
        end = min(iu + band, math.floor((u + half) / edge)) + 1
        for ju in range(first, end):
            ou = ju * edge - u
            for jv in range(iv - band, iv + band + 1):
                ov = jv * edge - v
                distance = wu * ou + wv * ov
                weight = slope * (span - abs(wu * ov - wv * ou))
                if weight <= 0.0 or abs(distance) > reach:
                    continue
                if ju >> TILE_BITS != tu or jv >> TILE_BITS != tv or layer != last:
                    tu, tv, last = ju >> TILE_BITS, jv >> TILE_BITS, layer
                    jx, jy = (ju, jv) if u_is_x else (jv, ju)
                    slot = own_slot(tiles, particle, layer, jx, jy)
                if slot == 0:
                    n_dropped += 1
                    continue
                cell = tiles.cells[slot, index_in_tile(ju, jv)]
                total = cell[3] + weight
                gain = weight / total
                cell[0] += gain * (distance - cell[0])
                cell[1] += gain * (wx - cell[1])
                cell[2] += gain * (wy - cell[2])
                cell[3] = min(total, update.cap)
                if cell[4] == 0.0:
                    cell[4] = now
                elif cell[4] > 0.0 and cell[4] != now:
                    cell[4] = -cell[4]
    return n_dropped
