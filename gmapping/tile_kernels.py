"""Maps of many particles in one pool of tiles, which particles share until one writes to them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit

TILE_BITS = 4  # of a cell index: its position within the tile
TILE_SIDE = 1 << TILE_BITS
TILE_CELLS = TILE_SIDE * TILE_SIDE
TILE_MASK = TILE_SIDE - 1  # selects these bits


class Tiles(NamedTuple):
    """The maps of all particles: tables of slots in one pool.

    `cells` (slots, TILE_CELLS, k): k numbers per cell, defined by the matcher; `tables` (ny, nx,
    particles, layers): slot of each tile, 0 = never written; the address space is reserved for the
    largest map, memory is used where it was written; `references` (slots,): number of table entries
    that point at a slot; `free` (slots,): number of free slots, then these slots; `written`
    (ny, nx): whether any particle ever wrote a tile; `corner_x`, `corner_y`: index of tables[0, 0];
    `resolution` [m]; `axis_x`, `axis_y`: unit vector, normal of one of the walls.
    """

    cells: NDArray[np.float32]
    tables: NDArray[np.int32]
    references: NDArray[np.int32]
    free: NDArray[np.int32]
    written: NDArray[np.bool_]
    corner_x: int
    corner_y: int
    resolution: float
    axis_x: float = 1.0
    axis_y: float = 0.0


@njit(inner=True, borrows=True)
def cell_of(coordinate: float, resolution: float) -> int:
    """Index of the cell whose center, index * resolution, is nearest to a coordinate [m]. ours."""
    return math.floor(coordinate / resolution + 0.5)


@njit(inner=True, borrows=True)
def index_in_tile(ix: int, iy: int) -> int:
    """Index of a cell in its tile, row by row. ours."""
    return ((iy & TILE_MASK) << TILE_BITS) | (ix & TILE_MASK)


@njit(inner=True, borrows=True)
def slot_of(tiles: Tiles, particle: int, layer: int, ix: int, iy: int) -> int:
    """Slot of the tile with a cell; 0 if it was never written or is outside. ours."""
    tx, ty = (ix >> TILE_BITS) - tiles.corner_x, (iy >> TILE_BITS) - tiles.corner_y
    if tx < 0 or ty < 0 or ty >= tiles.tables.shape[0] or tx >= tiles.tables.shape[1]:
        return 0
    slot: int = tiles.tables[ty, tx, particle, layer]
    return slot


@njit(inner=True, borrows=True)
def own_slot(tiles: Tiles, particle: int, layer: int, ix: int, iy: int) -> int:
    """Slot of the tile with a cell, for writing by this particle alone; 0 if none is free.

    ours: copy on write; a tile is copied only while other table entries point at it.
    """
    tx, ty = (ix >> TILE_BITS) - tiles.corner_x, (iy >> TILE_BITS) - tiles.corner_y
    if tx < 0 or ty < 0 or ty >= tiles.tables.shape[0] or tx >= tiles.tables.shape[1]:
        return 0
    old: int = tiles.tables[ty, tx, particle, layer]
    if old > 0 and tiles.references[old] == 1:
        return old
    if tiles.free[0] == 0:
        return 0
    new: int = tiles.free[tiles.free[0]]
    tiles.free[0] -= 1
    tiles.references[new] = 1
    tiles.tables[ty, tx, particle, layer] = new
    if old == 0:  # free slots are zero
        tiles.written[ty, tx] = True
        return new
    tiles.references[old] -= 1
    for k in range(TILE_CELLS):  # loops: assigning slices takes numba seconds to compile
        for j in range(tiles.cells.shape[2]):
            tiles.cells[new, k, j] = tiles.cells[old, k, j]
    return new


@njit
def inherit(tiles: Tiles, ancestors: NDArray[np.int64]) -> None:
    """Give every particle the map of its ancestor, which is its own ancestor; free unused slots.

    ours: table entries are copied, tiles only counted. Where the maps were equal before, nothing is
    done. Freed slots are set to zero: zeros take no space in a saved state.
    """
    height, width, n, layers = tiles.tables.shape
    for y in range(height):
        for x in range(width):
            if not tiles.written[y, x]:
                continue
            entries = tiles.tables[y, x]
            for particle in range(n):
                for layer in range(layers):
                    slot, new = entries[particle, layer], entries[ancestors[particle], layer]
                    if slot == new:
                        continue
                    entries[particle, layer] = new
                    if new > 0:
                        tiles.references[new] += 1
                    if slot == 0:
                        continue
                    tiles.references[slot] -= 1
                    if tiles.references[slot] == 0:
                        tiles.free[0] += 1
                        tiles.free[tiles.free[0]] = slot
                        for k in range(TILE_CELLS):
                            for j in range(tiles.cells.shape[2]):
                                tiles.cells[slot, k, j] = 0.0
