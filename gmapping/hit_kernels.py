"""The map of mean hits, and the mean hit that is nearest to each cell."""

from __future__ import annotations

import math

from gmapping.tile_kernels import Tiles, cell_of, index_in_tile, own_slot
from slams.jit import njit
from slams.types import Floats

# A cell keeps the mean x and y [m] of its hits and their weight, then the mean hit of the 3 x 3
# cells around that is nearest to its center: x, y and the number of its cell, 1 to 9, 0 for none.
N_HIT_VALUES = 6


@njit
def insert_ends(tiles: Tiles, poses: Floats, ends: Floats, cap: float) -> int:
    """Add every end point to its cell, in every particle's map.

    [Grisetti07] the map of the beam end point model; ours: the cells around store the nearest mean
    hit, so that a match reads one cell in place of nine. poses (particles, 3) m, rad; ends (n, 5)
    x, y [m] in the base frame, two unused, beams; `cap` on a cell's weight; returns the number of
    cells without a free tile.
    """
    edge, n_dropped = tiles.resolution, 0
    for particle in range(poses.shape[0]):
        c, s = math.cos(poses[particle, 2]), math.sin(poses[particle, 2])
        for i in range(ends.shape[0]):
            x, y = ends[i, 0], ends[i, 1]
            px, py = poses[particle, 0] + c * x - s * y, poses[particle, 1] + s * x + c * y
            ix, iy = cell_of(px, edge), cell_of(py, edge)
            slot = own_slot(tiles, particle, 0, ix, iy)
            if slot == 0:
                n_dropped += 1
                continue
            cell = tiles.cells[slot, index_in_tile(ix, iy)]
            total = cell[2] + ends[i, 4]
            gain = ends[i, 4] / total
            cell[0] += gain * (px - cell[0])
            cell[1] += gain * (py - cell[1])
            cell[2] = min(total, cap)
            hx, hy = cell[0], cell[1]
            for number in range(9):
                jx, jy = ix + number // 3 - 1, iy + number % 3 - 1
                slot = own_slot(tiles, particle, 0, jx, jy)
                if slot == 0:
                    continue
                around = tiles.cells[slot, index_in_tile(jx, jy)]
                cx, cy = jx * edge, jy * edge
                stored = (around[3] - cx) ** 2 + (around[4] - cy) ** 2
                nearer = (hx - cx) ** 2 + (hy - cy) ** 2 < stored
                if around[5] == 0.0 or around[5] == number + 1.0 or nearer:
                    around[3], around[4], around[5] = hx, hy, number + 1.0
    return n_dropped
