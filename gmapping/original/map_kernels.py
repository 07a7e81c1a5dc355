"""What a scan writes into the maps: means of end points, and where hits are near."""

from __future__ import annotations

import math

from gmapping.tile_kernels import Tiles, cell_of, inside_tile, own_slot
from slams.jit import njit
from slams.types import Floats

# A cell keeps the means of x and y [m] of its hits, their number, and which of the 3 x 3 cells
# around it were ever hit, as bits: bit 3 (dx + 1) + (dy + 1).


@njit
def insert_hits(tiles: Tiles, poses: Floats, points: Floats) -> int:
    """Add every end point to the cell it falls into, in every particle's map.

    [Grisetti07] original code: end points only, no free space. poses (particles, 3) m, rad;
    points (n, 2) m in the base frame; returns how many cells had no room.
    """
    lacking = 0
    for particle in range(poses.shape[0]):
        c, s = math.cos(poses[particle, 2]), math.sin(poses[particle, 2])
        for i in range(points.shape[0]):
            x, y = points[i, 0], points[i, 1]
            px, py = poses[particle, 0] + c * x - s * y, poses[particle, 1] + s * x + c * y
            ix, iy = cell_of(px, tiles.resolution), cell_of(py, tiles.resolution)
            slot = own_slot(tiles, particle, 0, ix, iy)
            if slot == 0:
                lacking += 1
                continue
            cell = tiles.cells[slot, inside_tile(ix, iy)]
            cell[2] += 1.0
            cell[0] += (px - cell[0]) / cell[2]
            cell[1] += (py - cell[1]) / cell[2]
            if cell[2] > 1.0:
                continue
            for bit in range(9):  # the first hit: the cells around learn of it
                jx, jy = ix + 1 - bit // 3, iy + 1 - bit % 3
                slot = own_slot(tiles, particle, 0, jx, jy)
                if slot > 0:
                    tiles.cells[slot, inside_tile(jx, jy), 3] += float(1 << bit)
    return lacking
