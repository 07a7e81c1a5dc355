"""TileField: the directional field, with tiles only where surfaces were observed."""

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
from tsd.drawing import MIN_DRAWN_WEIGHT, Drawing
from tsd.map_kernels import (
    LIKELIHOOD_STRIDE,
    N_LAYERS,
    TSD_TILE_SIDE,
    Field,
    PushRule,
    carve,
    list_rows,
    push_rows,
)
from tsd.match_kernels import MatchRule, align, evaluate
from tsd.params import TsdParams
from tsd.scan import SurfaceScan

MAX_ROWS_PER_SCAN = 1 << 14  # rows of cells that the lines of one scan cross
MIN_FIELD_ERROR = 0.001  # m, lower limit of the error that is learned
STEP_TOLERANCE = 1e-4, 1e-5  # m, rad: a smaller step ends Gauss-Newton and ICP
Arrays = tuple[NDArray[np.int32], NDArray[np.uint8], NDArray[np.float32]]


class TileField:
    """Map of signed distances near surfaces, in one layer per axis direction of the normals.

    `error` [m] is the error of these distances, from the residuals of the last match.

    Args:
        params: parameters.
    """

    def __init__(self, params: TsdParams) -> None:
        p = self.params = params
        self.insertions = 0
        self.error = p.range_noise
        self.extent = GridBounds(p.max_cells, p.cell)
        self._rows, self._scratch = np.zeros((MAX_ROWS_PER_SCAN, 4)), np.zeros((5, 3))
        self._storage = GridStorage(p.max_cells, p.cell, TSD_TILE_SIDE)
        slots, cell_state, likelihood = self._new_arrays()
        tiles = slots.size, TSD_TILE_SIDE, TSD_TILE_SIDE
        self.kernel = Field(
            slots=slots,
            tsd=zeros(tiles, np.float32),
            weight=zeros(tiles, np.float32),
            corner=np.array(self._storage.corner),
            cell=p.cell,
            used=np.ones(1, np.int64),
            cell_state=cell_state,
            likelihood=likelihood,
        )
        self.kernel.tsd[0] = np.nan

    @property
    def empty(self) -> bool:
        """Whether no scan has entered the map."""
        return self.insertions == 0

    def insert(self, scan: SurfaceScan, pose: Pose2) -> bool:
        """Push a scan taken at `pose`; False if it lies outside of the map's limits."""
        lines, box = scan.lines(pose)
        laser = pose @ scan.laser.mount
        return self.push(lines, box, scan.beams.angle_increment, laser.x, laser.y)

    def push(self, lines: Floats, box: Box, increment: float, x: float, y: float) -> bool:
        """Push lines (n, 7) in a box, measured from x, y [m] by beams `increment` [rad] apart."""
        p, margin = self.params, 0.5 + 2.0 * self.params.truncation
        box = box.joined(Box.around(x, y, 0.0))
        needed = Box(box.x0 - margin, box.y0 - margin, box.x1 + margin, box.y1 + margin)
        if not self.extent.admits(needed):
            return False
        self.insertions += 1
        self._cover(needed)
        rule = PushRule(p.truncation, p.max_weight, increment)
        n_rows = list_rows(self.kernel, lines, len(lines), rule, self._rows)
        push_rows(self.kernel, lines, self._rows, n_rows, rule)
        carve(self.kernel, lines, len(lines), x, y, rule)
        return True

    def align(self, scan: SurfaceScan, start: Pose2, prior: Prior) -> Match:
        """Gauss-Newton on the field from `start`, with the prior.

        ours, after ICP: exact to a fraction of a cell.
        """
        x, mean, scratch = np.array(start), np.array(prior.pose), self._scratch
        rule = MatchRule(self.params.iterations, *STEP_TOLERANCE, scan.softness, self.error)
        _, inliers, residual, _ = align(
            self.kernel, scan.elements, scan.count, mean, prior.information, rule, x, scratch
        )
        pose = Pose2(*x.tolist())
        if not all(map(math.isfinite, pose)):
            return Match(start)
        return Match(pose, inliers / scan.count, residual * residual, scratch[:3].copy())

    def learn(self, match: Match) -> None:
        """Estimate the error of the field from the residuals of a match."""
        self.error = max(self.params.map_noise * match.mean_square**0.5, MIN_FIELD_ERROR)

    def evaluate(self, points: EndPoints, pose: Pose2) -> tuple[float, float]:
        """Ratios of the elements that are inliers at a pose, and in conflict with the map."""
        if not isinstance(points, SurfaceScan):
            raise TypeError(f"points are of a {type(points).__name__}, expected a SurfaceScan")
        elements, n, at = points.elements, points.count, np.array(pose)
        inliers, conflicts = evaluate(self.kernel, elements, n, at, points.softness)
        n = max(n, 1)
        return inliers / n, conflicts / n

    def likelihood_field(self) -> LikelihoodField:
        """Likelihood of a surface in cells of half a tile: 1 at a surface, less beside it."""
        f = self.kernel
        cell = LIKELIHOOD_STRIDE * f.cell
        x, y = (f.corner + 0.5 * cell).tolist()
        return LikelihoodField(f.likelihood, x, y, cell)

    def grid(self) -> OccupancyGrid:
        """The present map."""
        return self.snapshot().draw()

    def crop(self, box: Box) -> OccupancyGrid | None:
        """Part of the map in a box; None if no cell in it was observed."""
        window = self._window(box)
        if not self.kernel.cell_state[window[0]].any():
            return None
        return self._drawing(window).draw()

    def snapshot(self) -> Drawing:
        """Copy of the arrays from which the map is drawn."""
        return self._drawing(self._window(self.extent.covered))

    def _drawing(self, window: tuple[tuple[slice, slice], tuple[slice, slice]]) -> Drawing:
        f, ((rows, columns), (ty, tx)) = self.kernel, window
        corner = f.corner + f.cell * np.array([columns.start, rows.start])
        slots = f.slots[ty, tx].copy()
        at = np.flatnonzero(slots)
        used = np.append(0, slots.flat[at])  # tile 0 is that without surfaces
        slots.flat[at] = np.arange(1, len(used))
        tsd = np.where(f.weight[used] >= MIN_DRAWN_WEIGHT, f.tsd[used], np.float32(np.nan))
        state = f.cell_state[rows, columns].copy()
        return Drawing(slots, tsd, state, f.cell, (float(corner[0]), float(corner[1])))

    def _window(self, box: Box) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
        """Slices of the cells and of the tiles in a box, within the covered part of the map."""
        covered, side = self.extent.covered, TSD_TILE_SIDE
        low = max(box.x0, covered.x0), max(box.y0, covered.y0)
        part = Box(*low, min(box.x1, covered.x1), min(box.y1, covered.y1))
        rows, columns = self._storage.window(part)
        tiles = [slice(at.start // side, -(-at.stop // side)) for at in (rows, columns)]
        cells = [slice(at.start * side, at.stop * side) for at in tiles]
        return (cells[0], cells[1]), (tiles[0], tiles[1])

    def _cover(self, box: Box) -> None:
        """Enlarge the arrays if a box is not inside."""
        added = self._storage.reach(box)
        if added is None:
            return
        f, (below, left) = self.kernel, added
        slots, state, lookup = self._new_arrays()
        move(f.slots, slots, below // TSD_TILE_SIDE, left // TSD_TILE_SIDE)
        move(f.cell_state, state, below, left)
        move(f.likelihood, lookup, below // LIKELIHOOD_STRIDE, left // LIKELIHOOD_STRIDE)
        corner = np.array(self._storage.corner)
        self.kernel = f._replace(slots=slots, cell_state=state, likelihood=lookup, corner=corner)

    def _new_arrays(self) -> Arrays:
        ny, nx = self._storage.height, self._storage.width
        slots = zeros((ny // TSD_TILE_SIDE, nx // TSD_TILE_SIDE, N_LAYERS), np.int32)
        likelihood = zeros((ny // LIKELIHOOD_STRIDE, nx // LIKELIHOOD_STRIDE), np.float32)
        return slots, zeros((ny, nx), np.uint8), likelihood
