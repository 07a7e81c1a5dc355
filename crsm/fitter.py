"""Fitter: least squares of all points of a scan to the walls of the map."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from crsm.map import WallGrid
from crsm.match_kernels import Rules, normal_equations
from crsm.params import CrsmParams
from crsm.scan import ScanReader
from slams.types import Pose2

ROUNDS, ENOUGH, ENOUGH_TURN = 20, 1e-4, 3e-5  # 1, m, rad
SAME_WALLS = 5e-3  # m, rad: after a step below this every point is still on its wall
Upper = tuple[float, float, float, float, float, float]  # xx, xy, xt, yy, yt, tt
Step = tuple[float, float, float]


class Fit(NamedTuple):
    """A pose of the laser, the quality 0..1 of the fit there and its information."""

    pose: Pose2
    quality: float
    information: Upper


class Fitter:
    """Gauss-Newton with the settings of one program."""

    def __init__(self, params: CrsmParams) -> None:
        p = params
        scales = (p.range_noise, p.lone_noise, p.lean, p.robust, p.agreement)
        self._rules = Rules(p.gate, p.compat, *(scale**2 for scale in scales))
        self._system = np.zeros(10)
        self._prior = (p.prior**-2, p.prior_turn**-2)

    def fit(self, walls: WallGrid, view: ScanReader, start: Pose2) -> Fit:
        """The pose, near `start`, from which the points lie on the walls."""
        x, y, theta = start
        look = 1.0
        for _ in range(ROUNDS):
            at = (x, y, theta, look)
            normal_equations(walls.cells, view.points, view.m, at, self._rules, self._system)
            h, g = self._with_prior(x - start.x, y - start.y, theta - start.theta)
            dx, dy, turn = solved(h, g)
            x, y, theta = x - dx, y - dy, theta - turn
            if max(abs(dx), abs(dy)) < ENOUGH and abs(turn) < ENOUGH_TURN:
                break
            look = float(max(abs(dx), abs(dy), abs(turn)) > SAME_WALLS)
        return Fit(Pose2(x, y, theta), float(self._system[9]) / view.m, h)

    def _with_prior(self, dx: float, dy: float, turn: float) -> tuple[Upper, Step]:
        """The equations of the points and of a start that lies (dx, dy, turn) behind."""
        xx, xy, xt, yy, yt, tt, gx, gy, gt, _ = self._system.tolist()
        k, kt = self._prior
        return (xx + k, xy, xt, yy + k, yt, tt + kt), (gx + k * dx, gy + k * dy, gt + kt * turn)


def solved(h: Upper, g: Step) -> Step:
    """H^-1 g of a symmetric H, by its cofactors; no step where H is singular."""
    a, b, c, d, e, f = h
    ca, cb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    cd, ce, cf = a * f - c * c, b * c - a * e, a * d - b * b
    det = a * ca + b * cb + c * cc
    if not det > 0.0:
        return 0.0, 0.0, 0.0
    x, y, z = g
    return (
        (ca * x + cb * y + cc * z) / det,
        (cb * x + cd * y + ce * z) / det,
        (cc * x + ce * y + cf * z) / det,
    )
