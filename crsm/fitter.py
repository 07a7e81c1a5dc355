"""Fitter: least squares of all points of a scan to the walls of the map."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from crsm.climb_kernels import Prior
from crsm.map import WallGrid
from crsm.match_kernels import Rules, fit_to_walls, normal_equations
from crsm.params import CrsmParams
from crsm.scan import ScanReader
from slams.types import Floats, Pose2

LEAST_RESIDUAL = 0.2  # of what is expected; a laser without noise is not believed more than that
MEMORY = 0.05  # weight of one scan in the usual residual


class Fit(NamedTuple):
    """Where the fit found the base.

    `information` (3, 3) of the scan alone [1/m^2, 1/(m rad), 1/rad^2]; `residual`, mean square of
    the residuals over what was expected; `agreement` 0..1, share of the points on their walls.
    """

    pose: Pose2
    information: Floats
    residual: float
    agreement: float


class Fitter:
    """Gauss-Newton, weighing walls against what is expected.

    The residuals of the scans so far tell by how much the walls are more or less exact than
    `range_noise` makes them; the prior is scaled to that.
    """

    def __init__(self, params: CrsmParams) -> None:
        p = params
        scales = (p.range_noise, p.lone_noise, p.lean, p.robust, p.agreement)
        self._rules = Rules(p.gate, p.compat, *(scale**2 for scale in scales))
        self._system = np.zeros(13)
        self._residual = 0.0
        self.scale = 1.0

    def fit(self, walls: WallGrid, view: ScanReader, start: Pose2, prior: Prior) -> Fit:
        """The pose of the base, near `start`, that walls and prior agree on best."""
        prior = prior._replace(weight=self.scale)
        cells, points = walls.cells, view.points
        pose = fit_to_walls(cells, points, view.m, tuple(start), prior, self._rules, self._system)
        return self._found(Pose2(*pose), view.m)

    def seen_from(self, walls: WallGrid, view: ScanReader, pose: Pose2) -> Fit:
        """What the walls say of a pose as it is, without a fit."""
        at = (*pose, 1.0)
        normal_equations(walls.cells, view.points, view.m, at, self._rules, self._system)
        return self._found(pose, view.m)

    def learn(self, fit: Fit) -> None:
        """Take this fit's residuals for usual."""
        self._residual += (MEMORY if self._residual else 1.0) * (fit.residual - self._residual)
        self.scale = max(self._residual, LEAST_RESIDUAL**2)

    def _found(self, pose: Pose2, m: int) -> Fit:
        xx, xy, xt, yy, yt, tt, *_, agreement, _, squares, weights = self._system.tolist()
        walls: Floats = np.array(((xx, xy, xt), (xy, yy, yt), (xt, yt, tt)))
        residual = squares / weights if weights > 0.0 else 1.0
        return Fit(pose, walls / max(self.scale, 1.0), residual, agreement / m)
