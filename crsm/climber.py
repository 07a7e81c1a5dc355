"""Climber: random restart hill climbing of the critical rays, within what is expected."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from crsm.climb_kernels import FINEST, Prior, climb, fitness, promising
from crsm.map import WallGrid
from crsm.params import CrsmParams
from crsm.scan import ScanReader
from slams.types import Floats, Pose2
from slams.usual import Usual

MEMORY = 2.0  # s over which the fitness is usual: the way through a room
LEAST_DOUBT = 0.05  # of a perfect fitness: what a prior counts at least
NEARBY = 0.008  # m, step from which on the field of `cells` is climbed: half a blot of it
FIRST_STEPS = (0.004, 0.064)  # m, least and most: a power of two times the last


class Climbed(NamedTuple):
    """The best pose of the base found, its fitness and the fitness less the prior's cost."""

    pose: Pose2
    fitness: float
    score: float


class Climber:
    """Climbs from the prediction; where that ends below the usual fitness, from other poses, too.

    Restarts are drawn with the covariance of what is expected, every second one from the window of
    `search_distance` and `search_angle`, and climbed from if they promise most.
    """

    def __init__(self, params: CrsmParams) -> None:
        self.params = params
        self._rng = np.random.default_rng(params.seed)
        self.usual = Usual(MEMORY)
        self.restarts = 0

    def prior(self, pose: Pose2, information: Floats, rays: int) -> Prior:
        """What is expected, weighed so that rays which the map explains badly say less."""
        doubt = max(1.0 - self.usual.value, LEAST_DOUBT)
        return Prior(*pose, information, 2.0 * doubt / rays)

    def climb(self, walls: WallGrid, view: ScanReader, prior: Prior, uncertain: float) -> Climbed:
        """Step 3 from the prediction alone; `uncertain` [m] is its deviation."""
        start = Pose2(prior.x, prior.y, prior.theta)
        return self._climb(walls, view, prior, start, uncertain)

    def restart(
        self, walls: WallGrid, view: ScanReader, prior: Prior, others: list[Pose2], best: Climbed
    ) -> Climbed:
        """Step 3, restarts: from the `others` first, then drawn; ends when one is good enough."""
        p, rays = self.params, view.ends
        drawn = self._draws(prior, p.restarts)
        starts = np.concatenate((np.array(others).reshape(-1, 3), drawn))
        promises = np.empty(len(starts))
        promising(walls.broad, rays, prior, starts, promises)
        order = np.argsort(-promises[len(others) :], kind="stable")[: p.climbs] + len(others)
        for i in (*range(len(others)), *order.tolist()):
            self.restarts += 1
            found = self._climb(walls, view, prior, Pose2(*starts[i].tolist()), math.inf)
            best = found if found.score > best.score else best
            if self.is_enough(best):
                break
        return best

    def is_enough(self, found: Climbed) -> bool:
        """Whether the search may end."""
        return found.fitness >= self.params.enough * self.usual.value

    def learn(self, walls: WallGrid, view: ScanReader, pose: Pose2, t: float) -> None:
        """Take the fitness of the pose at time `t` [s] for usual."""
        self.usual.learn(fitness(walls.cells, view.ends, tuple(pose)), t)

    def _climb(
        self, walls: WallGrid, view: ScanReader, prior: Prior, start: Pose2, uncertain: float
    ) -> Climbed:
        """With long steps on the broad field, then on the sharp one."""
        low, high = FIRST_STEPS
        step = low
        while step < high and step < uncertain:
            step *= 2.0
        at: tuple[float, ...] = tuple(start)
        if step > NEARBY and walls.broad is not walls.cells:
            x, y, theta, _ = climb(walls.broad, view.ends, prior, at, step, NEARBY)
            at, step = (x, y, theta), NEARBY
        x, y, theta, score = climb(walls.cells, view.ends, prior, at, step, FINEST)
        return Climbed(Pose2(x, y, theta), fitness(walls.cells, view.ends, (x, y, theta)), score)

    def _draws(self, prior: Prior, n: int) -> Floats:
        """Poses (n, 3) around what is expected."""
        p = self.params
        covariance = np.linalg.inv(prior.information)
        spread = np.linalg.cholesky(covariance)
        around = self._rng.standard_normal((n - n // 2, 3)) @ spread.T
        window = np.array([p.search_distance, p.search_distance, p.search_angle])
        around = np.clip(around, -window, window)
        wide = self._rng.uniform(-1.0, 1.0, (n // 2, 3)) * window
        at = np.array([prior.x, prior.y, prior.theta])
        return np.asarray(at + np.concatenate((around, wide)))
