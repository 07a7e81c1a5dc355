"""The two data structures: the directional field of tiles, and the published grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats, OccupancyGrid
from tsd import grid_kernels
from tsd.field_kernels import SIDE, Field, PushRule, carve, list_tiles, update_tiles
from tsd.grid_kernels import Grid, Mask, Sensor
from tsd.surface_kernels import Beams

FREE, OCCUPIED = 0.1, 0.9
Image = NDArray[np.float32]
Picture = tuple[Image, Image, float, tuple[float, float]]


class TileField:
    """Signed distances near surfaces, in one layer per facing, in tiles that grow with the map.

    Args:
        cell: edge of a cell [m].
        truncation: greatest distance kept [m].
        max_weight: cap of a cell's weight.
    """

    def __init__(self, cell: float, truncation: float, max_weight: float) -> None:
        self.truncation = truncation
        self._max_weight = max_weight
        self._pushes = 0
        side = 32
        self.kernel = Field(
            slots=np.full((4, side, side), -1, np.int32),
            tsd=np.full((1024, SIDE, SIDE), np.nan, np.float32),
            weight=np.zeros((1024, SIDE, SIDE), np.float32),
            corner=np.full(2, -0.5 * side * SIDE * cell),
            cell=cell,
            used=np.zeros(1, np.int64),
            stamp=np.zeros((side, side), np.int64),
            visited=np.zeros(side * side, np.int64),
            seen=np.zeros((side * SIDE, side * SIDE), np.uint8),
        )

    def push(
        self,
        lines: Floats,
        gaps: Floats,
        line_of_beam: NDArray[np.int64],
        beams: Beams,
        laser: Floats,
    ) -> None:
        """Enter surface lines (n, 7), seen from the laser's pose (3,), see `field_kernels`."""
        count = len(lines)
        self._pushes += 1
        rule = PushRule(self.truncation, self._max_weight, 2 * self._pushes)
        listed = list_tiles(self.kernel, lines, count, gaps, rule)
        while listed < 0:
            self._more_tiles()
            rule = rule._replace(number=rule.number + 1)
            listed = list_tiles(self.kernel, lines, count, gaps, rule)
        update_tiles(self.kernel, listed, lines, line_of_beam, beams, laser, rule)
        gap = abs(beams.angle_increment)
        carve(self.kernel, lines, count, float(laser[0]), float(laser[1]), gap, rule)

    def occupancy(self) -> OccupancyGrid:
        """Occupied where the field crosses zero, free where beams passed, nan elsewhere."""
        f = self.kernel
        p = np.where(f.seen > 0, np.float32(FREE), np.float32(np.nan))
        for layer in range(4):
            p[zero_crossings(self._dense(layer, f.tsd))] = OCCUPIED
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

    def cover(self, box: tuple[float, float, float, float], margin: float) -> None:
        """Grow the table of tiles until it holds a box (x0, y0, x1, y1) [m] with a margin."""
        f = self.kernel
        size = f.cell * SIDE
        margin += self.truncation
        ny, nx = f.stamp.shape
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
        stamp = np.pad(f.stamp, frame)
        self.kernel = f._replace(
            slots=np.pad(f.slots, [(0, 0), *frame], constant_values=-1),
            corner=f.corner - before * size,
            stamp=stamp,
            visited=np.zeros(stamp.size, np.int64),
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
