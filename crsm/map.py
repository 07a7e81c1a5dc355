"""WallGrid: the global map in memory, and how it grows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crsm.map_kernels import (
    BLUR,
    NX,
    NY,
    ROUND,
    WEIGHT,
    WIDTH,
    Joining,
    WallMap,
    X,
    Y,
    add_points,
    redraw,
    whiten,
)
from crsm.params import CrsmParams
from slams.cells import Room, move, zeros
from slams.extent import Box, Extent
from slams.refine.lines import LineMap
from slams.scan.end_points import EndPoints
from slams.types import Floats, OccupancyGrid, Pose2

STROKE = 1.0  # map cells, sigma of a blot along its wall, where a field is sharp: without bumps
BROAD = 2  # dark cells along a map cell that are climbed from afar
RIM = 4  # cells around what a scan needs
KNOWN = 0.1  # grey level, either way, from which a cell counts as seen
ONE_WALL = 0.6  # cells between an end point and the wall element it joins
FREE = -0.5  # grey level of what several drawings found free
MARGIN = 2.0  # cells that a beam goes on behind a wall to have gone through it
CORE = 0.25  # cells around the mean end point of an element that is surely wall
Cells = NDArray[np.int64]  # (m,) numbers of cells, counted along the rows


class WallGrid:
    """A map centered on the start that grows with the scans put into it."""

    def __init__(self, params: CrsmParams) -> None:
        self.params = params
        self.extent = Extent(params.max_cells, params.cell / params.fine)
        self._room = Room(params.max_cells, params.cell / params.fine, params.fine)
        self._width = BLUR
        self.cells = self._blank()
        self.broad = self._blank_broad()
        self._joining = Joining(ONE_WALL * params.cell, params.compat, params.max_weight)
        self._touched = np.zeros(0, np.int64)
        self.lines = LineMap(params, self.cells.grey, self._first, params.cell / params.fine)
        self.is_empty = True
        self._drawings = 0

    def insert(self, scan: EndPoints, pose: Pose2) -> bool:
        """Let a scan taken at `pose` enter walls and lines; False if the map may not grow so."""
        if not self._make_room(pose, scan.far):
            return False
        if len(self._touched) < scan.n:
            self._touched = np.zeros(scan.n, np.int64)
        n, touched = scan.n, self._touched
        count = add_points(self.cells, scan.points, scan.normals, n, pose, self._joining, touched)
        which = touched[:count]
        self._forget(which[self._stand_in_white(which)])
        self._width = max(BLUR, scan.noise * self.params.sharp / self.params.cell)
        self._redraw(which)
        if self.params.refine:
            self.lines.insert(scan, pose)
        self.is_empty = False
        return True

    def _stand_in_white(self, cells: Cells) -> NDArray[np.bool_]:
        """Which wall elements stand where beams went through: those of things that move."""
        at, (x, y) = self._elements(cells), self.cells.corner
        step = self.cells.cell / self.cells.fine
        ix, iy = (at[X] - x) / step, (at[Y] - y) / step
        white = self.cells.grey[iy.astype(np.int64), ix.astype(np.int64)] < FREE
        return np.asarray(white & (at[WEIGHT] > 0.0))

    def _redraw(self, cells: Cells) -> None:
        redraw(self.cells, cells, self._width)
        if self.broad is not self.cells:
            redraw(self.broad, cells, BLUR)

    def _forget(self, cells: Cells) -> None:
        self.cells.wall.reshape(-1, WEIGHT + 1)[cells, WEIGHT] = 0.0

    def _elements(self, cells: Cells) -> Floats:
        """Wall elements (5, m) of cells."""
        flat = self.cells.wall.reshape(-1, WEIGHT + 1)
        return np.ascontiguousarray(np.take(flat, cells, axis=0).T)

    def _flat(self, ix: NDArray[np.int64], iy: NDArray[np.int64]) -> Cells:
        return np.asarray(iy * self.cells.wall.shape[1] + ix)

    def draw(self, scan: EndPoints, pose: Pose2) -> int:
        """Whiten the ways of a scan's beams, blacken their ends; returns the walls that are gone.

        Wall elements lose weight when beams go clean through them.
        """
        laser, ends = pose @ scan.mount, pose.transform(scan.points[:2, : scan.n].T)
        cells, seen = self.cells, np.ascontiguousarray(ends.T)
        step, (x, y) = cells.cell / cells.fine, cells.corner
        self._drawings += 1
        ends = np.stack(((seen[X] - x) / step, (seen[Y] - y) / step))
        self._blacken(*np.floor(ends).astype(np.int64))
        start = ((laser.x - x) / step, (laser.y - y) / step)
        whiten(cells, start, ends, self._drawings, self.params.density)
        near = self._walls_among(seen)
        gone = self._weaken(near[self._passed(laser, seen, near)])
        moved = near[self._stand_in_white(near)]
        self._forget(moved)
        self._redraw(moved)
        return gone + len(moved)

    def _blacken(self, ix: NDArray[np.int64], iy: NDArray[np.int64]) -> None:
        """Beams end in these grey cells: one step to black for each cell."""
        grey, drawn = self.cells.grey.ravel(), self.cells.drawn.ravel()
        cells = np.unique(iy * self.cells.grey.shape[1] + ix)
        step = self.params.density * self.params.obstacle_density
        old = grey[cells]
        grey[cells] = np.minimum(1.0, old + step * (1.0 - np.sqrt(old.clip(0.0))))
        drawn[cells] = self._drawings

    def _passed(self, laser: Pose2, seen: Floats, cells: Cells) -> NDArray[np.bool_]:
        """Through which of the wall elements in `cells` the beams next to them went."""
        rays = seen - np.array([[laser.x], [laser.y]])
        bearings = np.arctan2(rays[Y], rays[X])
        order = np.argsort(bearings)
        elements = self._elements(cells)
        elements[: Y + 1] -= np.array([[laser.x], [laser.y]])
        after = np.searchsorted(bearings[order], np.arctan2(elements[Y], elements[X]))
        through = np.zeros(len(cells), np.bool_)
        for beam in (order[after - 1], order[after % len(order)]):
            through |= went_through(elements, rays[:, beam], self.cells.cell)
        return through

    def _walls_among(self, seen: Floats) -> Cells:
        """The cells with walls in the smallest box around points."""
        (x, y), cell = self.cells.corner, self.cells.cell
        x0, x1 = (int((f(seen[X]) - x) / cell) for f in (np.min, np.max))
        y0, y1 = (int((f(seen[Y]) - y) / cell) for f in (np.min, np.max))
        iy, ix = np.nonzero(self.cells.blot[y0 : y1 + 1, x0 : x1 + 1, WIDTH])
        return self._flat(ix + x0, iy + y0)

    def _weaken(self, cells: Cells) -> int:
        """Fade the wall elements of these cells; returns how many are gone."""
        flat = self.cells.wall.reshape(-1, WEIGHT + 1)
        weight = (1.0 - self.params.fade) * flat[cells, WEIGHT] - 1.0
        flat[cells, WEIGHT] = np.maximum(weight, 0.0)
        gone = cells[weight <= 0.0]
        self._redraw(gone)
        return len(gone)

    def occupancy(self) -> OccupancyGrid:
        """The grey levels as probabilities, without the unseen rim."""
        window = self._room.window(self.extent.covered)
        grey = self.cells.grey[window]
        seen = np.abs(grey) > KNOWN
        rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
        y0, y1 = (int(rows[0]), int(rows[-1]) + 1) if rows.size else (0, 1)
        x0, x1 = (int(columns[0]), int(columns[-1]) + 1) if columns.size else (0, 1)
        p = (0.5 + 0.5 * grey[y0:y1, x0:x1]).astype(np.float32)
        p[~seen[y0:y1, x0:x1]] = np.nan
        step, (x, y) = self.cells.cell / self.cells.fine, self.cells.corner
        low = x + (window[1].start + x0) * step, y + (window[0].start + y0) * step
        return OccupancyGrid(p, step, low)

    def _blank(self) -> WallMap:
        room, fine, sharp = self._room, self.params.fine, self.params.sharp
        rows, columns = room.height // fine, room.width // fine
        walls, blots = (zeros((rows, columns, 5), np.float32) for _ in range(2))
        dark, shape = zeros((sharp * rows, sharp * columns), np.float32), (room.height, room.width)
        greys = zeros(shape, np.float32), zeros(shape, np.int32)
        stroke, cell = ROUND if sharp <= BROAD else STROKE, self.params.cell
        return WallMap(walls, blots, dark, *greys, room.corner, cell, fine, sharp, stroke)

    def _blank_broad(self) -> WallMap:
        """The same map with a dark field to climb from afar, where that to end on is sharper."""
        cells, sharp = self.cells, self.params.sharp
        if sharp <= BROAD:
            return cells
        rows, columns = cells.wall.shape[:2]
        blots, dark = (
            zeros((rows, columns, 5), np.float32),
            zeros((BROAD * rows, BROAD * columns), np.float32),
        )
        return cells._replace(blot=blots, dark=dark, sharp=BROAD)

    def _make_room(self, pose: Pose2, reach: float) -> bool:
        """Grow until everything within `reach` [m] of the pose is inside; False if too large."""
        old, fine = self.cells, self.params.fine
        needed = Box.around(pose.x, pose.y, reach + RIM * old.cell)
        if not self.extent.admits(needed):
            return False
        added = self._room.reach(needed)
        if added is not None:
            below, left = added
            self.cells = self._blank()
            parts = {"wall": 1, "blot": 1, "dark": old.sharp, "grey": fine}
            for name, k in parts.items():
                new = getattr(self.cells, name)
                move(getattr(old, name), new, k * (below // fine), k * (left // fine))
            old, self.broad = self.broad, self._blank_broad()
            if self.broad is not self.cells:
                move(old.blot, self.broad.blot, below // fine, left // fine)
                move(old.dark, self.broad.dark, BROAD * (below // fine), BROAD * (left // fine))
            self.lines.move(self.cells.grey, self._first, below, left)
        return True

    @property
    def _first(self) -> tuple[float, float]:
        """Center of the first grey cell [m]."""
        (x, y), half = self.cells.corner, 0.5 * self.cells.cell / self.cells.fine
        return x + half, y + half


def went_through(elements: Floats, rays: Floats, cell: float) -> NDArray[np.bool_]:
    """Which of k beams passed the core of its wall element and went on behind it.

    elements (5, k) and the ends of the beams, rays (2, k), as seen from the laser [m]. A beam along
    the wall, or one that ends at it, did not.
    """
    length = np.sqrt(rays[X] ** 2 + rays[Y] ** 2)
    x, y = rays / np.maximum(length, 1e-9)
    across = elements[X] * y - elements[Y] * x
    behind = length - elements[X] * x - elements[Y] * y
    lone = ~elements[NX:WEIGHT].any(axis=0)
    behind *= np.where(lone, 1.0, np.abs(elements[NX] * x + elements[NY] * y))
    return np.asarray((behind > MARGIN * cell) & (np.abs(across) < CORE * cell))
