"""Matcher: a scan to the pyramid."""

from __future__ import annotations

import numpy as np

from hector.map import LogOddsPyramid
from hector.match_kernels import Solver
from hector.params import HectorParams
from slams.geometry import Prior
from slams.refine.lines import ENOUGH, THINNED, Match
from slams.scan.end_points import EndPoints
from slams.types import Pose2

ROUGH, FINE = 0.05, 0.02  # of a cell: a step below is the last, before lines or a finer level
BLUR = 0.01  # least variance of 1 - M: a wall's ridge of cells is never exact


class Matcher:
    """Poses scans on a map."""

    def __init__(self, params: HectorParams, grids: LogOddsPyramid) -> None:
        self.params = params
        self._map = grids
        self._H = np.zeros((3, 3))
        self._made: dict[int, tuple[Solver, ...]] = {}

    def climb(self, points: EndPoints, start: Pose2, prior: Prior) -> Match:
        """Gauss-Newton on the occupancy, coarse to fine: [Kohlbrecher11] sec. IV-C."""
        solvers = self._solvers(points.n // ENOUGH)
        pose, share, square = self._map.match(points, start, prior, solvers, self._H)
        variance = self._map.lines.variance
        return Match(pose, share, variance, self._H / max(square, BLUR))

    def _solvers(self, most: int) -> tuple[Solver, ...]:
        """How each level is solved if not more than every `most`-th beam may be left out."""
        if most not in self._made:
            self._made[most] = tuple(self._solver(k, most) for k in range(self.params.levels))
        return self._made[most]

    def _solver(self, level: int, most: int) -> Solver:
        p = self.params
        steps, cell = p.steps_coarse if level else p.steps_fine, p.resolution * 2**level
        thinned = THINNED if p.refine else 2**level  # several beams end in one coarse cell
        stride = max(min(thinned, most), 1)
        if p.refine:
            tolerance = (ROUGH if stride > 1 else FINE) * cell
        else:
            tolerance = FINE * cell if level else p.converged
        return Solver(steps, p.max_shift, p.max_turn, tolerance, p.damping, stride)
