"""TileField: the directional field, in tiles that grow with the map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats, OccupancyGrid
from tsd.image import Image, Picture
from tsd.map_kernels import PASSED, SIDE, Field, PushRule, carve, list_rows, push_rows

FREE, OCCUPIED = 0.02, 0.98
CERTAIN = 0.5  # least weight of a cell that shows as a surface
STEEP, TWO_CELLS = 0.67, 1.3  # slope of the field across one surface, along its layer's axis
ROWS = 1 << 14  # of cells one scan can touch
POOL = 1 << 13  # tiles, doubled when half of them are taken
Box = tuple[float, float, float, float]
Mask = NDArray[np.bool_]


class TileField:
    """Signed distances near surfaces, in one layer per facing, in tiles that grow with the map.

    Args:
        cell: edge of a cell [m].
        truncation: greatest distance kept [m].
        max_weight: cap of a cell's weight.
    """

    def __init__(self, cell: float, truncation: float, max_weight: float) -> None:
        self._truncation = truncation
        self._max_weight = max_weight
        self._rows = np.zeros((ROWS, 4))
        side = 32
        self.kernel = Field(
            slots=np.full((4, side, side), -1, np.int32),
            tsd=np.full((POOL, SIDE, SIDE), np.nan, np.float32),
            weight=np.zeros((POOL, SIDE, SIDE), np.float32),
            corner=np.full(2, -0.5 * side * SIDE * cell),
            cell=cell,
            used=np.zeros(1, np.int64),
            seen=np.zeros((side * SIDE, side * SIDE), np.uint8),
        )

    def push(self, lines: Floats, box: Box, gap: float, x: float, y: float) -> None:
        """Enter lines (n, 7) of `place_lines` within a box, seen from x, y by beams `gap` apart."""
        if len(lines) == 0:
            return
        self._cover((min(box[0], x), min(box[1], y), max(box[2], x), max(box[3], y)))
        if self.kernel.used[0] > len(self.kernel.tsd) // 2:
            self._more_tiles()
        rule = PushRule(self._truncation, self._max_weight, gap)
        n_rows = list_rows(self.kernel, lines, len(lines), rule, self._rows)
        push_rows(self.kernel, lines, self._rows, n_rows, rule)
        carve(self.kernel, lines, len(lines), x, y, rule)

    def occupancy(self) -> OccupancyGrid:
        """Occupied where a surface crosses a cell, free where beams passed, nan elsewhere."""
        f = self.kernel
        p = np.where(f.seen & PASSED, np.float32(FREE), np.float32(np.nan))
        for layer in range(4):
            tsd, weight = self._dense(layer, f.tsd), self._dense(layer, f.weight)
            p[surface_cells(np.where(weight >= CERTAIN, tsd, np.nan), layer, f.cell)] = OCCUPIED
        return OccupancyGrid(p, f.cell, (float(f.corner[0]), float(f.corner[1])))

    def picture(self) -> Picture:
        """Of every cell the distance [m] to its closest surface, and the weight."""
        f = self.kernel
        tsd = np.stack([self._dense(layer, f.tsd) for layer in range(4)])
        weight = np.stack([self._dense(layer, f.weight) for layer in range(4)])
        nearest = np.where(np.isnan(tsd), np.inf, np.abs(tsd)).argmin(axis=0)[None]
        images = [np.take_along_axis(image, nearest, axis=0)[0] for image in (tsd, weight)]
        corner = (float(f.corner[0]), float(f.corner[1]))
        return images[0], np.nan_to_num(images[1]), f.cell, corner

    def _dense(self, layer: int, pool: Image) -> Image:
        slots = self.kernel.slots[layer]
        ny, nx = slots.shape
        tiles = np.full((ny, nx, SIDE, SIDE), np.nan, np.float32)
        tiles[slots >= 0] = pool[slots[slots >= 0]]
        image: Image = tiles.transpose(0, 2, 1, 3).reshape(ny * SIDE, nx * SIDE)
        return image

    def _cover(self, box: Box) -> None:
        """Grow the table of tiles until it holds a box and what is beside it."""
        f = self.kernel
        size = f.cell * SIDE
        margin = 0.5 + 2.0 * self._truncation
        ny, nx = f.slots.shape[1:]
        x0, y0 = float(f.corner[0]), float(f.corner[1])
        low_x, low_y = box[0] - margin - x0, box[1] - margin - y0
        high_x, high_y = box[2] + margin - x0, box[3] + margin - y0
        if low_x >= 0.0 and low_y >= 0.0 and high_x < nx * size and high_y < ny * size:
            return
        shape = np.array([nx, ny])
        low = np.floor(np.array([low_x, low_y]) / size).astype(int)
        high = np.floor(np.array([high_x, high_y]) / size).astype(int) + 1
        pad = shape // 4
        before = np.where(low < 0, pad - low, 0)
        after = np.where(high > shape, high - shape + pad, 0)
        frame = [(int(before[axis]), int(after[axis])) for axis in (1, 0)]
        cells = [(a * SIDE, b * SIDE) for a, b in frame]
        self.kernel = f._replace(
            slots=np.pad(f.slots, [(0, 0), *frame], constant_values=-1),
            corner=f.corner - before * size,
            seen=np.pad(f.seen, cells),
        )

    def _more_tiles(self) -> None:
        f = self.kernel
        self.kernel = f._replace(
            tsd=np.concatenate([f.tsd, np.full_like(f.tsd, np.nan)]),
            weight=np.concatenate([f.weight, np.zeros_like(f.weight)]),
        )


def surface_cells(tsd: Image, layer: int, cell: float) -> Mask:
    """Cells of one layer that hold a surface: the zero between neighbors along the layer's axis.

    The distance must rise towards the side the surface faces, by what one surface makes it
    rise over a cell [m]: borders between two surfaces do not show.
    """
    image = tsd if layer % 2 == 0 else tsd.T
    a, b = (image[:, :-1], image[:, 1:]) if layer < 2 else (image[:, 1:], image[:, :-1])
    rise = (b - a) / cell
    crossing = (a <= 0.0) & (b > 0.0) & (rise > STEEP) & (rise < TWO_CELLS)
    behind, before = crossing & (-a <= b), crossing & (-a > b)
    low, high = (behind, before) if layer < 2 else (before, behind)
    occupied = np.zeros(image.shape, np.bool_)
    occupied[:, :-1] |= low
    occupied[:, 1:] |= high
    return occupied if layer % 2 == 0 else occupied.T
