"""TileField: the directional field, in tiles that are there where surfaces were seen."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slams.cells import GridStorage, move, zeros
from slams.frontend.correlative import LikelihoodField
from slams.geometry import Prior
from slams.grid_bounds import Box, GridBounds
from slams.refine.lines import Match
from slams.scan.end_points import EndPoints
from slams.types import Floats, OccupancyGrid, Pose2
from tsd.drawing import CERTAIN, Drawing
from tsd.map_kernels import (
    LAYERS,
    SIDE,
    WALL,
    Field,
    PushRule,
    carve,
    list_rows,
    push_rows,
)
from tsd.match_kernels import MatchRule, align, evaluate
from tsd.params import TsdParams
from tsd.scan import SurfaceScan

ROWS = 1 << 14  # of cells one scan can touch
LEAST_ERROR = 0.001  # m
STOP = 1e-4, 1e-5  # steps of Gauss-Newton [m], [rad] that are none
Table = tuple[NDArray[np.int32], NDArray[np.uint8], NDArray[np.float32]]


class TileField:
    """Signed distances near surfaces, in one layer per facing.

    `error` [m] is that of the field, by the last match.

    Args:
        params: parameters.
    """

    def __init__(self, params: TsdParams) -> None:
        p = self.params = params
        self.insertions = 0
        self.error = p.range_noise
        self.extent = GridBounds(p.max_cells, p.cell)
        self._rows, self._equations = np.zeros((ROWS, 4)), np.zeros((5, 3))
        self._room = GridStorage(p.max_cells, p.cell, SIDE)
        slots, seen, walls = self._table()
        tiles = slots.size, SIDE, SIDE
        self.kernel = Field(
            slots=slots,
            tsd=zeros(tiles, np.float32),
            weight=zeros(tiles, np.float32),
            corner=np.array(self._room.corner),
            cell=p.cell,
            used=np.ones(1, np.int64),
            seen=seen,
            walls=walls,
        )
        self.kernel.tsd[0] = np.nan

    @property
    def empty(self) -> bool:
        """Whether no scan has entered the map."""
        return self.insertions == 0

    def insert(self, scan: SurfaceScan, pose: Pose2) -> bool:
        """Let a scan taken at `pose` enter; False if the map does not grow so far."""
        lines, box = scan.lines(pose)
        laser = pose @ scan.laser.mount
        return self.push(lines, box, scan.beams.angle_increment, laser.x, laser.y)

    def push(self, lines: Floats, box: Box, gap: float, x: float, y: float) -> bool:
        """Enter lines (n, 7) of `place_lines` within a box, seen from x, y by beams `gap` apart."""
        p, beside = self.params, 0.5 + 2.0 * self.params.truncation
        box = box.joined(Box.around(x, y, 0.0))
        needed = Box(box.x0 - beside, box.y0 - beside, box.x1 + beside, box.y1 + beside)
        if not self.extent.admits(needed):
            return False
        self.insertions += 1
        self._cover(needed)
        rule = PushRule(p.truncation, p.max_weight, gap)
        n_rows = list_rows(self.kernel, lines, len(lines), rule, self._rows)
        push_rows(self.kernel, lines, self._rows, n_rows, rule)
        carve(self.kernel, lines, len(lines), x, y, rule)
        return True

    def align(self, scan: SurfaceScan, start: Pose2, prior: Prior) -> Match:
        """Gauss-Newton on the field from `start`; the prior holds it where the scan does not.

        ours, behind ICP: exact to a fraction of a cell.
        """
        x, mean, room = np.array(start), np.array(prior.pose), self._equations
        rule = MatchRule(self.params.iterations, *STOP, scan.softness, self.error)
        _, close, residual, _ = align(
            self.kernel, scan.elements, scan.count, mean, prior.information, rule, x, room
        )
        pose = Pose2(*x.tolist())
        if not all(map(math.isfinite, pose)):
            return Match(start)
        return Match(pose, close / scan.count, residual * residual, room[:3].copy())

    def learn(self, match: Match) -> None:
        """Take this match's distances for the error of the field."""
        self.error = max(self.params.map_noise * match.mean_square**0.5, LEAST_ERROR)

    def evaluate(self, points: EndPoints, pose: Pose2) -> tuple[float, float]:
        """Shares of the elements that are inliers at a pose, and in conflict with the map."""
        if not isinstance(points, SurfaceScan):
            raise TypeError(f"points are of a {type(points).__name__}, expected a SurfaceScan")
        elements, n, at = points.elements, points.count, np.array(pose)
        inliers, conflicts = evaluate(self.kernel, elements, n, at, points.softness)
        n = max(n, 1)
        return inliers / n, conflicts / n

    def likelihood_field(self) -> LikelihoodField:
        """Cells of half a tile, 1 where a surface crosses them, less beside it."""
        f = self.kernel
        cell = WALL * f.cell
        x, y = (f.corner + 0.5 * cell).tolist()
        return LikelihoodField(f.walls, x, y, cell)

    def grid(self) -> OccupancyGrid:
        """The map as it stands."""
        return self.snapshot().draw()

    def crop(self, box: Box) -> OccupancyGrid | None:
        """The part of the map in a box, None if nothing was observed there."""
        window = self._window(box)
        if not self.kernel.seen[window[0]].any():
            return None
        return self._drawing(window).draw()

    def snapshot(self) -> Drawing:
        """A copy of what the map is drawn from."""
        return self._drawing(self._window(self.extent.covered))

    def _drawing(self, window: tuple[tuple[slice, slice], tuple[slice, slice]]) -> Drawing:
        f, ((rows, columns), (ty, tx)) = self.kernel, window
        corner = f.corner + f.cell * np.array([columns.start, rows.start])
        used = int(f.used[0])
        tsd = np.where(f.weight[:used] >= CERTAIN, f.tsd[:used], np.float32(np.nan))
        slots, seen = f.slots[ty, tx].copy(), f.seen[rows, columns].copy()
        return Drawing(slots, tsd, seen, f.cell, (float(corner[0]), float(corner[1])))

    def _window(self, box: Box) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
        """The whole tiles in a box that were covered: their cells, and themselves."""
        seen = self.extent.covered
        low = max(box.x0, seen.x0), max(box.y0, seen.y0)
        rows, columns = self._room.window(Box(*low, min(box.x1, seen.x1), min(box.y1, seen.y1)))
        tiles = [slice(at.start // SIDE, -(-at.stop // SIDE)) for at in (rows, columns)]
        cells = [slice(at.start * SIDE, at.stop * SIDE) for at in tiles]
        return (cells[0], cells[1]), (tiles[0], tiles[1])

    def _cover(self, box: Box) -> None:
        """Have room for a box."""
        added = self._room.reach(box)
        if added is None:
            return
        f, (below, left) = self.kernel, added
        slots, seen, walls = self._table()
        move(f.slots, slots, below // SIDE, left // SIDE)
        move(f.seen, seen, below, left)
        move(f.walls, walls, below // WALL, left // WALL)
        corner = np.array(self._room.corner)
        self.kernel = f._replace(slots=slots, seen=seen, walls=walls, corner=corner)

    def _table(self) -> Table:
        ny, nx = self._room.height, self._room.width
        slots = zeros((ny // SIDE, nx // SIDE, LAYERS), np.int32)
        walls = zeros((ny // WALL, nx // WALL), np.float32)
        return slots, zeros((ny, nx), np.uint8), walls
