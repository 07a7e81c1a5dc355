"""The map of the published program: mean end points, and which neighbor cells have hits."""

from __future__ import annotations

import math

from gmapping.tile_kernels import Tiles, cell_of, index_in_tile, own_slot
from slams.jit import njit
from slams.types import Floats

# A cell keeps the mean x and y [m] of its hits, their number, and a mask of the 3 x 3 cells around
# that have hits: bit 3 (dx + 1) + (dy + 1).


@njit
def insert_hits(tiles: Tiles, poses: Floats, points: Floats) -> int:
    """Add every end point to its cell, in every particle's map.

    [Grisetti07] original code: end points only, no free space. poses (particles, 3) m, rad;
    points (n, 2) m in the base frame; returns the number of cells without a free tile.
    """
    n_dropped = 0
    for particle in range(poses.shape[0]):
        c, s = math.cos(poses[particle, 2]), math.sin(poses[particle, 2])
        for i in range(points.shape[0]):
            x, y = points[i, 0], points[i, 1]
            px, py = poses[particle, 0] + c * x - s * y, poses[particle, 1] + s * x + c * y
            ix, iy = cell_of(px, tiles.resolution), cell_of(py, tiles.resolution)
            slot = own_slot(tiles, particle, 0, ix, iy)
            if slot == 0:
                n_dropped += 1
                continue
            cell = tiles.cells[slot, index_in_tile(ix, iy)]
            cell[2] += 1.0
            cell[0] += (px - cell[0]) / cell[2]
            cell[1] += (py - cell[1]) / cell[2]
            if cell[2] > 1.0:
                continue
            for bit in range(9):  # at the first hit, set the bit in the cells around
                jx, jy = ix + 1 - bit // 3, iy + 1 - bit % 3
                slot = own_slot(tiles, particle, 0, jx, jy)
                if slot > 0:
                    tiles.cells[slot, index_in_tile(jx, jy), 3] += float(1 << bit)
    return n_dropped
