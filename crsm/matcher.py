"""Matcher: random restart hill climbing of the critical rays."""

from __future__ import annotations

from typing import Any

import numpy as np

from crsm import match_kernels
from crsm.map import GrayMap
from crsm.params import CrsmParams
from crsm.scan import ScanReader
from slams.frontend.motion_filter import Prediction
from slams.refine.lines import Match
from slams.types import Floats, Pose2

MEAN_FITNESS_SCANS = 20  # scans of the moving average of the fitness
LAST_STEP, LAST_STEP_BEFORE_LINES = 0.0005, 0.008  # m, of a climb; without and with a fit to lines
FIRST_STEP = 0.016  # m, of a climb from the prediction
FIRST_RESTART_STEP = 0.128  # m, of a climb from elsewhere

ClimbResult = tuple[tuple[float, float, float], float, float]  # pose, fitness, score


class Matcher:
    """Climbs from a start, and from random poses where the fitness is below `mean_fitness`."""

    def __init__(self, params: CrsmParams, grids: GrayMap) -> None:
        self.params = params
        self.restarts = 0
        self._map = grids
        self._rng = np.random.default_rng(params.seed)
        self.mean_fitness = 0.0
        self._last_step = LAST_STEP_BEFORE_LINES if params.refine else LAST_STEP

    def climb(self, points: ScanReader, start: Pose2, prior: Prediction) -> Match:
        """[Tsardoulias13] random restart hill climbing: the best pose that is found.

        Only a climb from the prediction is restarted: other starts are results of a search.
        """
        weight = (points.noise / (self.params.stroke * self.params.cell)) ** 2
        pose_prior = *prior.pose, prior.information, weight / max(len(points.ends), 1)
        grids = tuple(map(tuple, self._map.levels))
        predicted = start == prior.pose
        length = FIRST_STEP if predicted else FIRST_RESTART_STEP
        ends, at = points.ends, tuple(start)
        best: ClimbResult
        best = match_kernels.climb(grids, ends, pose_prior, at, length, self._last_step)
        if predicted and best[1] < self.params.enough * self.mean_fitness:
            best = self._restart(grids, ends, pose_prior, start, best)
        pose, fitness = Pose2(*best[0]), best[1]
        if self.params.refine:
            return Match(pose, fitness)
        return Match(pose, fitness, points.noise**2, points.information(pose.theta) * fitness)

    def learn(self, points: ScanReader, pose: Pose2) -> None:
        """Update the mean fitness by the pose of the last scan."""
        fitness = match_kernels.fitness_of(tuple(self._map.levels[0]), points.ends, tuple(pose))
        self.mean_fitness += (fitness - self.mean_fitness) / MEAN_FITNESS_SCANS

    def _restart(
        self, grids: Any, ends: Floats, prior: Any, start: Pose2, best: ClimbResult
    ) -> ClimbResult:
        """The best of several climbs: `best`, one with long steps, and those from random poses.

        Of the random poses those with the best scores on the coarse grid are used.
        """
        p = self.params
        window = np.array((p.search_distance, p.search_distance, p.search_angle))
        starts = np.array(start) + self._rng.uniform(-1.0, 1.0, (p.restarts, 3)) * window
        scores, first, last = np.empty(p.restarts), FIRST_RESTART_STEP, self._last_step
        match_kernels.score_starts(grids[1], ends, prior, starts, scores)
        order = np.argsort(-scores, kind="stable")[: p.climbs]
        for at in (tuple(start), *map(tuple, starts[order].tolist())):
            self.restarts += 1
            found: ClimbResult = match_kernels.climb(grids, ends, prior, at, first, last)
            best = found if found[2] > best[2] else best
            if best[1] >= p.enough * self.mean_fitness:
                break
        return best
