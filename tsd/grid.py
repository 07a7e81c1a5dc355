"""The two data structures: the directional field of tiles, and the published grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats, OccupancyGrid
from tsd import grid_kernels
from tsd.field_kernels import PASSED, SIDE, Field, PushRule, carve, list_rows, push_rows
from tsd.grid_kernels import Grid, Mask, Sensor

FREE, OCCUPIED = 0.02, 0.98
CERTAIN = 0.5  # least weight of a cell that shows as a surface
UNKNOWN = 205.0  # shade of a picture's unknown cells
STEEP, TWO_CELLS = 0.67, 1.3  # slope of the field across one surface, along its layer's axis
ROWS = 1 << 14  # of cells one scan can touch
POOL = 1 << 13  # tiles, doubled when half of them are taken
BLOCKS = grid_kernels.SIDE // grid_kernels.BLOCK
Image = NDArray[np.float32]
Box = tuple[float, float, float, float]
Picture = tuple[Image, Image, float, tuple[float, float]]


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


class TsdGrid:
    """The grid of the original code: one value per cell, partitions of 32 x 32 cells.

    Args:
        cell: edge of a cell [m].
        truncation: greatest distance kept [m].
        side: cells per edge at the start, a multiple of 32.
        grows: whether it may grow when the robot comes near its edge.
    """

    def __init__(self, cell: float, truncation: float, side: int, grows: bool) -> None:
        n = max(side // grid_kernels.SIDE, 1)
        cells = n * grid_kernels.SIDE
        self._grows = grows
        self.kernel = Grid(
            tsd=np.full((cells, cells), np.nan, np.float32),
            weight=np.zeros((cells, cells), np.float32),
            allocated=np.zeros((n, n), np.bool_),
            emptiness=np.zeros((n, n)),
            near=np.zeros((n * BLOCKS, n * BLOCKS), np.bool_),
            corner=np.full(2, -0.5 * cells * cell),
            cell=cell,
            truncation=max(truncation, 2.0 * cell),
        )

    def push(self, laser: Floats, ranges: Floats, mask: Mask, sensor: Sensor) -> None:
        """Enter a scan taken at the laser's pose (3,)."""
        if self._grows:
            self._cover(laser, ranges[mask & np.isfinite(ranges)])
        grid_kernels.push(self.kernel, laser, ranges, mask, sensor)

    def occupancy(self) -> OccupancyGrid:
        """Occupied where the field crosses zero, free where positive or empty, nan elsewhere."""
        g = self.kernel
        empty = (g.emptiness > 0.0) & ~g.allocated
        free = np.kron(empty, np.ones((grid_kernels.SIDE, grid_kernels.SIDE), np.bool_))
        p = np.where(free | (g.tsd > 0.0), np.float32(FREE), np.float32(np.nan))
        p[zero_crossings(g.tsd)] = OCCUPIED
        return OccupancyGrid(p, g.cell, (float(g.corner[0]), float(g.corner[1])))

    def picture(self) -> Picture:
        """Of every cell the distance [m] and the weight."""
        g = self.kernel
        corner = (float(g.corner[0]), float(g.corner[1]))
        return g.tsd * np.float32(g.truncation), g.weight.copy(), g.cell, corner

    def _cover(self, laser: Floats, ranges: Floats) -> None:
        g = self.kernel
        reach = float(ranges.max(initial=0.0)) + 1.0
        size = g.cell * grid_kernels.SIDE
        shape = np.array(g.allocated.shape[::-1])
        low = np.floor((laser[:2] - reach - g.corner) / size).astype(int)
        high = np.ceil((laser[:2] + reach - g.corner) / size).astype(int)
        if (low >= 0).all() and (high <= shape).all():
            return
        before = np.where(low < 0, shape // 4 - low, 0)
        after = np.where(high > shape, high - shape + shape // 4, 0)
        frame = [(int(before[axis]), int(after[axis])) for axis in (1, 0)]
        cells = [(a * grid_kernels.SIDE, b * grid_kernels.SIDE) for a, b in frame]
        self.kernel = g._replace(
            tsd=np.pad(g.tsd, cells, constant_values=np.nan),
            weight=np.pad(g.weight, cells),
            allocated=np.pad(g.allocated, frame),
            emptiness=np.pad(g.emptiness, frame),
            near=np.pad(g.near, [(a * BLOCKS, b * BLOCKS) for a, b in frame]),
            corner=g.corner - before * size,
        )


def zero_crossings(tsd: Image) -> Mask:
    """Cells that hold the zero between two neighbors of opposite signs, to a fraction of a cell."""
    occupied = np.zeros(tsd.shape, np.bool_)
    for first, second in (
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1, :], np.s_[1:, :]),
    ):
        a, b = tsd[first], tsd[second]
        crossing = (a > 0.0) & (b <= 0.0) | (a <= 0.0) & (b > 0.0)
        closer = np.abs(a) <= np.abs(b)
        occupied[first] |= crossing & closer
        occupied[second] |= crossing & ~closer
    return occupied


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


def colored(tsd: Image, truncation: float) -> NDArray[np.uint8]:
    """The field as a picture (ny, nx, 3), blue, green, red, north up.

    Blue before a surface, red behind, the paler the farther; gray where nothing is known.
    """
    pale = 255.0 * np.clip(np.abs(tsd) / truncation, 0.0, 1.0)
    full = np.full_like(pale, 255.0)
    blue, red = np.where(tsd > 0.0, full, pale), np.where(tsd > 0.0, pale, full)
    image = np.stack([blue, pale, red], axis=2)
    known = np.isfinite(tsd)
    image[~known] = UNKNOWN
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if rows.size == 0:
        rows = columns = np.zeros(1, np.int64)
    part = image[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return np.ascontiguousarray(part[::-1].astype(np.uint8))
