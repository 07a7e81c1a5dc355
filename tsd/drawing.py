"""Drawing: the occupancy grid that is shown and saved, from tiles of the directional field."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.types import OccupancyGrid
from tsd.map_kernels import BEHIND_BIT, N_LAYERS, PASS_BITS, TSD_TILE_SIDE

FREE_CELL_PROBABILITY, SURFACE_CELL_PROBABILITY = 0.02, 0.98
MIN_DRAWN_WEIGHT = 0.5  # weight from which a cell is drawn as a surface
MIN_AXIS_SLOPE, MAX_AXIS_SLOPE = 0.67, 1.3  # of the field across one surface, on its layer's axis
STATE_PROBABILITY = np.full(1 + (PASS_BITS | BEHIND_BIT), FREE_CELL_PROBABILITY, np.float32)
STATE_PROBABILITY[[0, BEHIND_BIT]] = np.nan  # no beam passed
Image = NDArray[np.float32]
Mask = NDArray[np.bool_]
Ints = NDArray[np.int64]


class Drawing(NamedTuple):
    """Copy of a part of the field, from which an occupancy grid is drawn.

    `slots` (ny, nx, 4), `tsd` [m] and `cell_state` as in `Field`; `corner` x, y [m] is the outer
    corner of the first cell.
    """

    slots: NDArray[np.int32]
    tsd: Image
    cell_state: NDArray[np.uint8]
    cell: float
    corner: tuple[float, float]

    def draw(self) -> OccupancyGrid:
        """Occupied where a surface crosses a cell, free where beams passed, nan elsewhere."""
        p = STATE_PROBABILITY[self.cell_state]
        for layer in range(N_LAYERS):
            p[self._surface(layer)] = SURFACE_CELL_PROBABILITY
        return OccupancyGrid(p, self.cell, self.corner)

    def _surface(self, layer: int) -> tuple[Ints, Ints]:
        """Rows and columns of the cells that hold a surface of one layer."""
        transposed = layer % 2 == 1  # the layer's axis is y: x and y change places
        slots = self.slots[..., layer].T if transposed else self.slots[..., layer]
        ty, tx = np.nonzero(slots)
        tiles, next_slots = self.tsd[slots[ty, tx]], np.zeros(len(tx), np.int64)
        inside = tx + 1 < slots.shape[1]
        next_slots[inside] = slots[ty[inside], tx[inside] + 1]
        next_tiles = self.tsd[next_slots]
        if transposed:
            tiles, next_tiles = tiles.transpose(0, 2, 1), next_tiles.transpose(0, 2, 1)
        image = np.concatenate([tiles, next_tiles[:, :, :1]], axis=2)
        k, j, i = np.nonzero(surface_cells(image, layer, self.cell))
        y, x = ty[k] * TSD_TILE_SIDE + j, tx[k] * TSD_TILE_SIDE + i
        return (x, y) if transposed else (y, x)


def surface_cells(tsd: Image, layer: int, cell: float) -> Mask:
    """Cells (..., n) that hold a surface: the zero between neighbors along the layer's axis.

    `tsd` (..., n) [m]; its last index runs along the axis. The distance has to increase towards
    the front of the surface with the slope of one surface: a change of sign between two surfaces
    has another slope and is not drawn. ours.
    """
    one, next_one = tsd[..., :-1], tsd[..., 1:]
    a, b = (one, next_one) if layer < 2 else (next_one, one)
    slope = (b - a) / cell
    crossing = (a <= 0.0) & (b > 0.0) & (slope > MIN_AXIS_SLOPE) & (slope < MAX_AXIS_SLOPE)
    behind, before = crossing & (-a <= b), crossing & (-a > b)
    low, high = (behind, before) if layer < 2 else (before, behind)
    occupied = np.zeros(tsd.shape, np.bool_)
    occupied[..., :-1] |= low
    occupied[..., 1:] |= high
    return occupied
