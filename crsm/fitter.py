"""Fitter: least squares of all points of a scan to the walls of the map."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from crsm.map import WallGrid
from crsm.match_kernels import Rules, normal_equations
from crsm.params import CrsmParams
from crsm.scan import ScanReader
from slams.types import Floats, Pose2, wrap_angle

ROUNDS, ENOUGH, ENOUGH_TURN = 20, 1e-4, 3e-5  # 1, m, rad
SAME_WALLS = 5e-3  # m, rad: after a step below this every point is still on its wall
LEAST_RESIDUAL = 0.2  # of what is expected; a laser without noise is not believed more than that
MEMORY = 0.05  # weight of one scan in the usual residual
BLIND = 10.0  # m, rad, deviation of a fit along a way it does not see
Upper = tuple[float, float, float, float, float, float]  # xx, xy, xt, yy, yt, tt
Step = tuple[float, float, float]


class Belief(NamedTuple):
    """What is believed of a pose: its mean and covariance (3, 3) [m, rad] in the map frame.

    `eased` is by how much more than that a fit may leave it.
    """

    pose: Pose2
    covariance: Floats
    eased: float = 1.0

    def moved(self, pose: Pose2) -> Belief:
        """The same of a frame fixed to it that is at `pose`."""
        lever = np.eye(3)
        lever[0, 2], lever[1, 2] = self.pose.y - pose.y, pose.x - self.pose.x
        return Belief(pose, lever @ self.covariance @ lever.T, self.eased)


class Fit(NamedTuple):
    """Where the fit found the laser.

    `belief` with the `prior` and `alone` without it; `quality` 0..1; `cost`, the negative logarithm
    of the posterior; `residual`, mean square of the residuals over what was expected;
    `surprise`, the same of the distance between walls and prior.
    """

    belief: Belief
    alone: Belief
    prior: Belief
    quality: float
    cost: float
    residual: float
    surprise: float


class Fitter:
    """Gauss-Newton, weighing walls against what is believed before.

    The residuals of the scans so far tell by how much the walls are more or less exact than
    `range_noise` makes them; the prior is scaled to that.
    """

    def __init__(self, params: CrsmParams) -> None:
        p = params
        scales = (p.range_noise, p.lone_noise, p.lean, p.robust, p.agreement)
        self._rules = Rules(p.gate, p.compat, *(scale**2 for scale in scales))
        self._system = np.zeros(13)
        self._independent = float(p.critical_rays)
        self._residual = 0.0
        self._scale = 1.0

    def fit(self, walls: WallGrid, view: ScanReader, start: Pose2, prior: Belief) -> Fit:
        """The pose of the laser, near `start`, that walls and prior agree on best."""
        information = np.asarray(self._scale / prior.eased * np.linalg.inv(prior.covariance))
        (xx, xy, xt), (_, yy, yt), (_, _, tt) = information.tolist()
        k = (xx, xy, xt, yy, yt, tt)
        x, y, theta = start
        x0, y0, heading = prior.pose
        heading = theta - wrap_angle(theta - heading)
        look = 1.0
        for _ in range(ROUNDS):
            at = (x, y, theta, look)
            normal_equations(walls.cells, view.points, view.m, at, self._rules, self._system)
            h, g = self._with_prior(k, (x - x0, y - y0, theta - heading))
            dx, dy, turn = solved(h, g)
            x, y, theta = x - dx, y - dy, theta - turn
            if max(abs(dx), abs(dy)) < ENOUGH and abs(turn) < ENOUGH_TURN:
                break
            look = float(max(abs(dx), abs(dy), abs(turn)) > SAME_WALLS)
        off = np.array([x - x0, y - y0, theta - heading])
        return self._found(view, prior, Pose2(x, y, wrap_angle(theta)), information, off)

    def learn(self, fit: Fit) -> None:
        """Take this fit's residuals for usual."""
        self._residual += (MEMORY if self._residual else 1.0) * (fit.residual - self._residual)
        self._scale = max(self._residual, LEAST_RESIDUAL**2)

    def _found(
        self, view: ScanReader, prior: Belief, pose: Pose2, information: Floats, off: Floats
    ) -> Fit:
        xx, xy, xt, yy, yt, tt, _, _, _, agreement, loss, squares, weights = self._system.tolist()
        walls: Floats = np.array(((xx, xy, xt), (xy, yy, yt), (xt, yt, tt)))
        ridge = np.eye(3) / BLIND**2
        both = np.asarray(self._scale * np.linalg.inv(walls + prior.eased * information))
        alone = np.asarray(max(self._scale, 1.0) * np.linalg.inv(walls + ridge))
        share = min(1.0, self._independent / view.m)
        cost = 0.5 * (share * loss + float(off @ information @ off)) / self._scale
        residual = squares / weights if weights > 0.0 else 1.0
        apart = off + alone @ information @ off / self._scale  # walls from prior
        surprise = float(apart @ np.linalg.solve(prior.covariance + alone, apart)) / 3.0
        found = Belief(pose, both), Belief(pose, alone)
        return Fit(*found, prior, agreement / view.m, cost, residual, surprise)

    def _with_prior(self, k: Upper, off: Step) -> tuple[Upper, Step]:
        """The equations of the points and of a prior with information k that lies `off` behind."""
        xx, xy, xt, yy, yt, tt, gx, gy, gt = self._system[:9].tolist()
        a, b, c, d, e, f = k
        x, y, t = off
        g = (gx + a * x + b * y + c * t, gy + b * x + d * y + e * t, gt + c * x + e * y + f * t)
        return (xx + a, xy + b, xt + c, yy + d, yt + e, tt + f), g


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
