"""Maps of many particles in one pool of tiles, shared until written to."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit

BITS = 4
SIDE = 1 << BITS
CELLS = SIDE * SIDE
LAST = SIDE - 1


class Tiles(NamedTuple):
    """The maps of all particles: tables of slots in one pool.

    `cells` (slots, CELLS, k) k numbers a cell, whatever the matcher keeps there; `tables`
    (ny, nx, particles, layers) slot of each tile, 0 = never touched: reserved for the largest map,
    in memory where it was touched; `references` (slots,) how many tables point at a slot; `free`
    (slots,) how many slots are free, then these slots; `window` (4,) indices of the tiles that were
    touched: first x, y, last x, y; `corner_x`, `corner_y` index of tables[0, 0]; `resolution` [m];
    `axis_x`, `axis_y` a unit vector, the way one of the walls faces.
    """

    cells: NDArray[np.float32]
    tables: NDArray[np.int32]
    references: NDArray[np.int32]
    free: NDArray[np.int32]
    window: NDArray[np.int64]
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
def inside_tile(ix: int, iy: int) -> int:
    """Place of a cell in its tile, row by row. ours."""
    return ((iy & LAST) << BITS) | (ix & LAST)


@njit(inner=True, borrows=True)
def slot_of(tiles: Tiles, particle: int, layer: int, ix: int, iy: int) -> int:
    """Slot of the tile that holds a cell, 0 if absent or outside. ours."""
    tx, ty = (ix >> BITS) - tiles.corner_x, (iy >> BITS) - tiles.corner_y
    if tx < 0 or ty < 0 or ty >= tiles.tables.shape[0] or tx >= tiles.tables.shape[1]:
        return 0
    slot: int = tiles.tables[ty, tx, particle, layer]
    return slot


@njit(inner=True, borrows=True)
def own_slot(tiles: Tiles, particle: int, layer: int, ix: int, iy: int) -> int:
    """Slot of a tile that only this particle has, to write to; 0 if there is no room.

    ours: copy on write; a tile is copied only while another table points at it too.
    """
    tx, ty = (ix >> BITS) - tiles.corner_x, (iy >> BITS) - tiles.corner_y
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
        x, y, window = ix >> BITS, iy >> BITS, tiles.window
        window[0], window[1] = min(window[0], x), min(window[1], y)
        window[2], window[3] = max(window[2], x), max(window[3], y)
        return new
    tiles.references[old] -= 1
    for k in range(CELLS):  # loops: assigning slices takes numba seconds to compile
        for j in range(tiles.cells.shape[2]):
            tiles.cells[new, k, j] = tiles.cells[old, k, j]
    return new


@njit
def inherit(tiles: Tiles, ancestors: NDArray[np.int64]) -> None:
    """Hand every particle the map of its ancestor, which keeps its own; unused slots become free.

    ours: tables are copied, tiles only counted, and those of the past both have in common. Free
    slots are made zero: what is zero takes no room in a saved state.
    """
    _, _, n, layers = tiles.tables.shape
    for y in range(tiles.window[1], tiles.window[3] + 1):
        for x in range(tiles.window[0], tiles.window[2] + 1):
            here, seen = tiles.tables[y - tiles.corner_y, x - tiles.corner_x], 0
            for particle in range(n):  # most of a window was never touched
                for layer in range(layers):
                    seen |= here[particle, layer]
            if seen == 0:
                continue
            for particle in range(n):
                for layer in range(layers):
                    slot, new = here[particle, layer], here[ancestors[particle], layer]
                    if slot == new:
                        continue
                    here[particle, layer] = new
                    if new > 0:
                        tiles.references[new] += 1
                    if slot == 0:
                        continue
                    tiles.references[slot] -= 1
                    if tiles.references[slot] == 0:
                        tiles.free[0] += 1
                        tiles.free[tiles.free[0]] = slot
                        for k in range(CELLS):
                            for j in range(tiles.cells.shape[2]):
                                tiles.cells[slot, k, j] = 0.0
