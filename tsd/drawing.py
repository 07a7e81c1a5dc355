"""Drawing: the map that people see, from tiles of the directional field."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.types import OccupancyGrid
from tsd.map_kernels import BEHIND, LAYERS, PASSED, SIDE

FREE, OCCUPIED = 0.02, 0.98
CERTAIN = 0.5  # least weight of a cell that shows as a surface
STEEP, TWO_CELLS = 0.67, 1.3  # slope of the field across one surface, along its layer's axis
SHOWN = np.full(1 + (PASSED | BEHIND), FREE, np.float32)  # of what `seen` says
SHOWN[[0, BEHIND]] = np.nan
Image = NDArray[np.float32]
Mask = NDArray[np.bool_]
Ints = NDArray[np.int64]


class Drawing(NamedTuple):
    """Part of a field: `slots` (ny, nx, 4) of tiles `tsd` (n, SIDE, SIDE) [m], 0 for none.

    `seen` (ny SIDE, nx SIDE) holds the bits PASSED and BEHIND, `corner` [m] is that of it.
    """

    slots: NDArray[np.int32]
    tsd: Image
    seen: NDArray[np.uint8]
    cell: float
    corner: tuple[float, float]

    def draw(self) -> OccupancyGrid:
        """Occupied where a surface crosses a cell, free where beams passed, nan elsewhere."""
        p = SHOWN[self.seen]
        for layer in range(LAYERS):
            p[self._surface(layer)] = OCCUPIED
        return OccupancyGrid(p, self.cell, self.corner)

    def _surface(self, layer: int) -> tuple[Ints, Ints]:
        """Rows and columns of the cells that hold a surface of one layer."""
        turned = layer % 2 == 1  # its axis goes along columns: as if x were y
        slots = self.slots[..., layer].T if turned else self.slots[..., layer]
        ty, tx = np.nonzero(slots)
        tiles, beside = self.tsd[slots[ty, tx]], np.zeros(len(tx), np.int64)
        inside = tx + 1 < slots.shape[1]
        beside[inside] = slots[ty[inside], tx[inside] + 1]
        edge = self.tsd[beside]
        if turned:
            tiles, edge = tiles.transpose(0, 2, 1), edge.transpose(0, 2, 1)
        image = np.concatenate([tiles, edge[:, :, :1]], axis=2)
        k, j, i = np.nonzero(surface_cells(image, layer, self.cell))
        y, x = ty[k] * SIDE + j, tx[k] * SIDE + i
        return (x, y) if turned else (y, x)


def surface_cells(tsd: Image, layer: int, cell: float) -> Mask:
    """Cells (..., n) that hold a surface: the zero between neighbors along the layer's axis.

    The last index of `tsd` goes along the axis. The distance must rise towards the side the surface
    faces, by what one surface makes it rise over a cell [m]: borders between two surfaces do not
    show.
    """
    one, next_one = tsd[..., :-1], tsd[..., 1:]
    a, b = (one, next_one) if layer < 2 else (next_one, one)
    rise = (b - a) / cell
    crossing = (a <= 0.0) & (b > 0.0) & (rise > STEEP) & (rise < TWO_CELLS)
    behind, before = crossing & (-a <= b), crossing & (-a > b)
    low, high = (behind, before) if layer < 2 else (before, behind)
    occupied = np.zeros(tsd.shape, np.bool_)
    occupied[..., :-1] |= low
    occupied[..., 1:] |= high
    return occupied
