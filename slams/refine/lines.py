"""LineMap: lines inside the cells of a grid, made of the scans themselves, and the fit to them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.cells import move, zeros
from slams.geometry import Prior
from slams.refine.line_cell_kernels import LAYERS, SUMS, Splat, Surface, add_scan
from slams.refine.line_kernels import Fit, evaluate, fit
from slams.refine.params import RefineParams
from slams.scan.end_points import EndPoints, pose_distance
from slams.types import Floats, Pose2

THINNED, ENOUGH = 4, 180  # a fit begins with every fourth beam, if those are so many
NEAR = 0.2  # of a cell: a step below it is the last of so few beams
LAST = 10.0  # times `converged`, from close by: of many beams the next step is a fifteenth
SOFT = 3.0  # deviations of the noise at which a beam counts half
ONCE = 0.1  # trust in a line that one scan alone has seen: it may have been a leg
STANDING = 0.5  # the same, times s, of scans so far apart: no leg is there still when it matters
BLURRED = 2.0  # deviations of the noise that a hit may lie off the cell of its wall
CLOSE, SAME = 0.5, 0.25  # of a cell: starts that lead to the same lines; fits that are one
LEAST_ROWS, CELLS_PER_ROW = 1 << 18, 16  # of the pool: few cells have a wall
Grid = NDArray[np.float32]


NO_INFORMATION = np.zeros((3, 3))


class Match(NamedTuple):
    """A matched pose and how well it fits.

    The share of beams that the map explains, the variance of their distance from it [m^2], the
    information (3, 3) of the scan about the pose [1/m^2, 1/(m rad), 1/rad^2]. `coarse`: where the
    paper's mechanism ended, that it began from.
    """

    pose: Pose2
    inlier_ratio: float = 1.0
    mean_square: float = 0.0
    information: Floats = NO_INFORMATION
    coarse: Pose2 | None = None


class LineMap:
    """Lines of walls in the cells of a grid; `variance` [m^2] is that of a beam's distance.

    Args:
        params: of the lines and the fit.
        seen: what the grid says of its cells, (ny, nx).
        first: center of cell [0, 0], x, y [m].
        cell: edge of a cell [m].
        free: what it says of free cells is below; one scan alone should not get there.
    """

    def __init__(
        self,
        params: RefineParams,
        seen: Grid,
        first: tuple[float, float],
        cell: float,
        free: float,
    ) -> None:
        self.params = params
        self.variance = params.range_noise**2
        self._scans = 0
        self._H = np.zeros((3, 3))
        rows = max(LEAST_ROWS, seen.size // CELLS_PER_ROW)
        sums, lines = zeros((rows, LAYERS * SUMS), np.float32), zeros((rows, 8), np.float32)
        slot = zeros(seen.shape, np.int32)
        self.surface = Surface(slot, sums, lines, np.zeros(1, np.int64), seen, *first, cell, free)

    def move(self, seen: Grid, first: tuple[float, float], below: int, left: int) -> None:
        """The grid has grown, by so many cells below and at the left."""
        slot = zeros(seen.shape, np.int32)
        move(self.surface.slot, slot, below, left)
        self.surface = self.surface._replace(slot=slot, seen=seen, x0=first[0], y0=first[1])

    def insert(self, points: EndPoints, pose: Pose2) -> None:
        """Let a scan taken at `pose` enter; hits of a noisy laser reach more cells."""
        p = self.params
        self._scans += 1
        reach = max(p.reach, math.ceil(BLURRED * points.noise / self.surface.resolution))
        once = max(STANDING * points.scan_interval, ONCE)
        splat = Splat(reach, p.side, p.weight_cap, self._scans, once)
        add_scan(self.surface, points.points, points.normals, points.n, pose, splat)

    def fit(self, points: EndPoints, start: Pose2, prior: Prior, close: bool = False) -> Match:
        """Gauss-Newton on the distances to the lines.

        From a start that is `close` all beams take part at once: one step is enough.
        """
        stride = max(min(THINNED, points.n // ENOUGH), 1)
        near, soft = NEAR * self.surface.resolution, self._softness(points)
        tolerance = self.params.converged * (LAST if close and stride > 1 else stride)
        how = Fit(
            self.params.line_steps, tolerance, near, 1 if close else stride, soft, self.variance
        )
        view, H = (points.points, points.rough_normals, points.n, tuple(points.mount)), self._H
        known = tuple(prior.pose), prior.information
        pose, share, square = fit(tuple(self.surface), view, tuple(start), known, tuple(how), H)
        variance = max(square, points.noise**2)
        return Match(Pose2(*pose), share, variance, H / variance)

    def refine(self, points: EndPoints, start: Pose2, coarse: Pose2, prior: Prior) -> list[Match]:
        """Fits from where a match by cells began, and from where it ended if that is elsewhere.

        Within half a cell both meet the same lines, and the start is the nearer: cells end
        millimeters off.
        """
        cell = self.surface.resolution
        if pose_distance(points, coarse, start) <= CLOSE * cell:
            return [self.fit(points, start, prior, close=True)]
        found = [self.fit(points, start, prior), self.fit(points, coarse, prior)]
        same = pose_distance(points, found[0].pose, found[1].pose) <= SAME * cell
        return found[1:] if same else found

    def evaluate(self, points: EndPoints, pose: Pose2) -> tuple[float, float]:
        """Shares of the beams that lie on a line at a pose, and that end where it was free."""
        view = tuple(points.mount), tuple(pose), 1.0 / self._softness(points) ** 2
        stride = max(min(THINNED, points.n // ENOUGH), 1)
        return evaluate(tuple(self.surface), points.points, points.n, stride, *view)

    def learn(self, match: Match, points: EndPoints) -> None:
        """Take this match's distances for usual."""
        self.variance = max(match.mean_square, points.noise**2)

    def _softness(self, points: EndPoints) -> float:
        return max(self.params.softness, SOFT * points.noise)
