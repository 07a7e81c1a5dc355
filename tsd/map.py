"""TileField: the directional field, in tiles that are there where surfaces were seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slams.cells import Room, move, zeros
from slams.extent import USUAL_CELLS, Box
from slams.types import Floats
from tsd.drawing import CERTAIN, Drawing
from tsd.image import Image, Picture
from tsd.map_kernels import LAYERS, SIDE, Field, PushRule, carve, list_rows, push_rows

ROWS = 1 << 14  # of cells one scan can touch
START = Box(0.0, 0.0, 0.0, 0.0)
Table = tuple[NDArray[np.int32], NDArray[np.uint8]]


class TileField:
    """Signed distances near surfaces, in one layer per facing.

    Args:
        cell: edge of a cell [m].
        truncation: greatest distance kept [m].
        max_weight: cap of a cell's weight.
        max_cells: cells of the largest map.
    """

    def __init__(
        self, cell: float, truncation: float, max_weight: float, max_cells: int = USUAL_CELLS
    ) -> None:
        self._truncation, self._max_weight = truncation, max_weight
        self._rows = np.zeros((ROWS, 4))
        self._room, self._covered = Room(max_cells, cell, SIDE), START
        slots, seen = self._table()
        tiles = slots.size, SIDE, SIDE
        self.kernel = Field(
            slots=slots,
            tsd=zeros(tiles, np.float32),
            weight=zeros(tiles, np.float32),
            corner=np.array(self._room.corner),
            cell=cell,
            used=np.ones(1, np.int64),
            seen=seen,
        )
        self.kernel.tsd[0] = np.nan

    def push(self, lines: Floats, box: Box, gap: float, x: float, y: float) -> None:
        """Enter lines (n, 7) of `place_lines` within a box, seen from x, y by beams `gap` apart."""
        if len(lines) == 0:
            return
        self._cover(box.joined(Box.around(x, y, 0.0)))
        rule = PushRule(self._truncation, self._max_weight, gap)
        n_rows = list_rows(self.kernel, lines, len(lines), rule, self._rows)
        push_rows(self.kernel, lines, self._rows, n_rows, rule)
        carve(self.kernel, lines, len(lines), x, y, rule)

    def sketch(self) -> Drawing:
        """What the map is drawn from, taken quickly."""
        f, used = self.kernel, int(self.kernel.used[0])
        (rows, columns), (ty, tx) = self._window()
        corner = f.corner + f.cell * np.array([columns.start, rows.start])
        tsd = np.where(f.weight[:used] >= CERTAIN, f.tsd[:used], np.float32(np.nan))
        slots, seen = f.slots[ty, tx].copy(), f.seen[rows, columns].copy()
        return Drawing(slots, tsd, seen, f.cell, (float(corner[0]), float(corner[1])))

    def picture(self) -> Picture:
        """Of every cell the distance [m] to its closest surface, and the weight."""
        f, ((rows, columns), _) = self.kernel, self._window()
        tsd = np.stack([self._dense(layer, f.tsd) for layer in range(LAYERS)])
        weight = np.stack([self._dense(layer, f.weight) for layer in range(LAYERS)])
        nearest = np.where(np.isnan(tsd), np.inf, np.abs(tsd)).argmin(axis=0)[None]
        images = [np.take_along_axis(image, nearest, axis=0)[0] for image in (tsd, weight)]
        corner = f.corner + f.cell * np.array([columns.start, rows.start])
        return images[0], images[1], f.cell, (float(corner[0]), float(corner[1]))

    def _dense(self, layer: int, pool: Image) -> Image:
        """One layer of the part of the map that was seen, as an image."""
        slots = self.kernel.slots[self._window()[1]][..., layer]
        ny, nx = slots.shape
        image: Image = pool[slots].transpose(0, 2, 1, 3).reshape(ny * SIDE, nx * SIDE)
        return image

    def _window(self) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
        """The whole tiles that were touched: their cells, and themselves."""
        rows, columns = self._room.window(self._covered)
        tiles = [slice(at.start // SIDE, -(-at.stop // SIDE)) for at in (rows, columns)]
        cells = [slice(at.start * SIDE, at.stop * SIDE) for at in tiles]
        return (cells[0], cells[1]), (tiles[0], tiles[1])

    def _cover(self, box: Box) -> None:
        """Have room for a box and what is beside it."""
        f, beside = self.kernel, 0.5 + 2.0 * self._truncation
        box = Box(box.x0 - beside, box.y0 - beside, box.x1 + beside, box.y1 + beside)
        self._covered = self._covered.joined(box)
        added = self._room.reach(box)
        if added is None:
            return
        below, left = added
        slots, seen = self._table()
        move(f.slots, slots, below // SIDE, left // SIDE)
        move(f.seen, seen, below, left)
        self.kernel = f._replace(slots=slots, seen=seen, corner=np.array(self._room.corner))

    def _table(self) -> Table:
        ny, nx = self._room.height, self._room.width
        slots = zeros((ny // SIDE, nx // SIDE, LAYERS), np.int32)
        return slots, zeros((ny, nx), np.uint8)
