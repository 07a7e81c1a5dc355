"""LineMap: lines inside the cells of a grid, built from scans, and the match to them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.cells import move, zeros
from slams.geometry import Prior
from slams.refine.line_cell_kernels import (
    LINES_PER_CELL,
    SUMS_PER_LINE,
    LineCells,
    LineUpdate,
    add_scan,
)
from slams.refine.line_kernels import Fit, evaluate, fit
from slams.refine.params import RefineParams
from slams.scan.end_points import ROBUST_SCALE_DEVIATIONS, EndPoints, pose_distance
from slams.types import Floats, Pose2

MAX_BEAM_STRIDE, MIN_USED_BEAMS = 4, 180  # a fit begins with every fourth beam, at least so many
STRIDE_STEP = 0.2  # of a cell: after a step below it all beams are used
CLOSE_TOLERANCE_RATIO = 10.0  # times `converged` from a close start: one step is enough
MIN_FIRST_CONFIDENCE = 0.1  # in a line of one scan alone: it may be a person's leg
CONFIDENCE_PER_INTERVAL = 0.5  # 1/s: the same for rare scans, before whose next one a leg is gone
HIT_SPREAD_DEVIATIONS = 2.0  # of the noise between a hit and the cell of its wall
CLOSE_START, SAME_FIT = 0.5, 0.25  # of a cell: start and coarse match meet the same lines; one fit
MIN_POOL_ROWS, CELLS_PER_POOL_ROW = 1 << 18, 16  # few cells have a wall
NO_INFORMATION = np.zeros((3, 3))
Grid = NDArray[np.float32]


class Match(NamedTuple):
    """A matched pose with inlier ratio and mean square distance of the inliers [m^2].

    `information` (3, 3) of the scan about the pose [1/m^2, 1/(m rad), 1/rad^2]; `coarse`: result of
    the paper's mechanism, from which the refinement started; `design_effect`: factor by which
    correlated errors of the beams have lowered the information.
    """

    pose: Pose2
    inlier_ratio: float = 1.0
    mean_square: float = 0.0
    information: Floats = NO_INFORMATION
    coarse: Pose2 | None = None
    design_effect: float = 1.0


class LineMap:
    """Lines of walls in the cells of a grid; `variance` [m^2] of a beam's distance from its line.

    Args:
        params: of the lines and the fit.
        grid: occupancy values (ny, nx), negative where mostly free.
        first: center of cell [0, 0], x, y [m].
        cell: edge of a cell [m].
        free: value below which a cell is free; a single scan should not reach it.
    """

    def __init__(
        self,
        params: RefineParams,
        grid: Grid,
        first: tuple[float, float],
        cell: float,
        free: float,
    ) -> None:
        self.params = params
        self.variance = params.range_noise**2
        self._scans = 0
        self._H = np.zeros((3, 3))
        rows = max(MIN_POOL_ROWS, grid.size // CELLS_PER_POOL_ROW)
        sums = zeros((rows, LINES_PER_CELL * SUMS_PER_LINE), np.float32)
        lines, slot = zeros((rows, 8), np.float32), zeros(grid.shape, np.int32)
        self.cells = LineCells(slot, sums, lines, np.zeros(1, np.int64), grid, *first, cell, free)

    def move(self, grid: Grid, first: tuple[float, float], below: int, left: int) -> None:
        """Follow the grid, which has grown by so many cells below and at the left."""
        slot = zeros(grid.shape, np.int32)
        move(self.cells.slot, slot, below, left)
        self.cells = self.cells._replace(slot=slot, grid=grid, x0=first[0], y0=first[1])

    def insert(self, points: EndPoints, pose: Pose2) -> None:
        """Add a scan taken at `pose`; hits of a noisy laser enter more cells."""
        p, noise = self.params, points.noise
        self._scans += 1
        reach = max(p.reach, math.ceil(HIT_SPREAD_DEVIATIONS * noise / self.cells.resolution))
        confidence = max(CONFIDENCE_PER_INTERVAL * points.scan_interval, MIN_FIRST_CONFIDENCE)
        update = LineUpdate(reach, p.side, p.weight_cap, self._scans, confidence)
        add_scan(self.cells, points.points, points.normals, points.n, pose, update)

    def fit(self, points: EndPoints, start: Pose2, prior: Prior, close: bool = False) -> Match:
        """Match by Gauss-Newton on the distances to the lines.

        From a `close` start all beams are used in the first step, which is enough.
        """
        p, stride, soft = self.params, _stride(points), self._softness(points)
        tolerance = p.converged * (CLOSE_TOLERANCE_RATIO if close and stride > 1 else stride)
        stride, stride_tolerance = 1 if close else stride, STRIDE_STEP * self.cells.resolution
        settings = Fit(p.line_steps, tolerance, stride_tolerance, stride, soft, self.variance)
        view, H = (points.points, points.rough_normals, points.n, tuple(points.mount)), self._H
        starts = tuple(start), (tuple(prior.pose), prior.information)
        pose, ratio, square, effect = fit(tuple(self.cells), view, *starts, tuple(settings), H)
        variance = max(square, points.noise**2)
        information = H / (variance * effect)
        return Match(Pose2(*pose), ratio, variance, information, design_effect=effect)

    def refine(self, points: EndPoints, start: Pose2, coarse: Pose2, prior: Prior) -> list[Match]:
        """Matches from the start of a `coarse` match, and from its result if that is elsewhere.

        Within half a cell both lead to the same lines, and the start is the better one: a match by
        cells has an error of millimeters.
        """
        cell = self.cells.resolution
        if pose_distance(points, coarse, start) <= CLOSE_START * cell:
            return [self.fit(points, start, prior, close=True)]
        matches = [self.fit(points, start, prior), self.fit(points, coarse, prior)]
        is_same = pose_distance(points, matches[0].pose, matches[1].pose) <= SAME_FIT * cell
        return matches[1:] if is_same else matches

    def evaluate(self, points: EndPoints, pose: Pose2) -> tuple[float, float]:
        """Inlier ratio and free-space conflict of a scan at a pose."""
        view = tuple(points.mount), tuple(pose), 1.0 / self._softness(points) ** 2
        return evaluate(tuple(self.cells), points.points, points.n, _stride(points), *view)

    def learn_variance(self, match: Match, points: EndPoints, wheels: bool) -> None:
        """Set `variance` to that of a match, by laser alone with the design effect.

        The errors of wheels are correlated, too, so the weight of their prior stays.
        """
        effect = 1.0 if wheels else match.design_effect
        self.variance = max(match.mean_square, points.noise**2) * effect

    def _softness(self, points: EndPoints) -> float:
        return max(self.params.softness, ROBUST_SCALE_DEVIATIONS * points.noise)


def _stride(points: EndPoints) -> int:
    """Every how many beams a fit uses at first."""
    return max(min(MAX_BEAM_STRIDE, points.n // MIN_USED_BEAMS), 1)
