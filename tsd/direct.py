"""Ours, behind ICP: Gauss-Newton on the field itself, exact to a fraction of a cell."""

from __future__ import annotations

import math

import numpy as np

from slams.geometry import Prior
from slams.refine.lines import Match
from slams.types import Pose2
from tsd.map import TileField
from tsd.match_kernels import MatchRule, align
from tsd.params import TsdParams
from tsd.scan import SurfaceScan

STOP = 1e-4, 1e-5  # steps [m], [rad] that are none


class Direct:
    """Fits the surface elements of a scan to the field.

    Args:
        params: parameters.
        field: the map.
    """

    def __init__(self, params: TsdParams, field: TileField) -> None:
        self._p, self._field = params, field
        self._room = np.zeros((5, 3))

    def align(self, scan: SurfaceScan, start: Pose2, prior: Prior) -> Match:
        """Gauss-Newton from `start`; the prior holds it where the scan does not."""
        x = np.array(start)
        rule = MatchRule(self._p.iterations, *STOP, scan.softness, self._field.error)
        mean = np.array(prior.pose)
        kernel, information, room = self._field.kernel, prior.information, self._room
        _, close, residual, _ = align(
            kernel, scan.elements, scan.count, mean, information, rule, x, room
        )
        pose = Pose2(*x.tolist())
        if not all(map(math.isfinite, pose)):
            return Match(start)
        return Match(pose, close / scan.count, residual * residual, room[:3].copy())
