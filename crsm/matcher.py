"""Matcher: random restart hill climbing of the critical rays."""

from __future__ import annotations

from typing import Any

import numpy as np

from crsm import match_kernels
from crsm.map import GreyMap
from crsm.params import CrsmParams
from crsm.scan import ScanReader
from slams.frontend.motion_filter import Prediction
from slams.refine.lines import Match
from slams.types import Floats, Pose2

MEMORY = 20  # scans over which the fitness is a mean
FINEST, ROUGH = 0.0005, 0.008  # m: last steps of a climb, alone and before a fit to lines
FIRST, LONGEST = 0.016, 0.128  # m, first step of a climb, from the prediction and of restarts

Climbed = tuple[tuple[float, float, float], float, float]  # pose, fitness, score


class Matcher:
    """Climbs from a start; where that ends below the `usual` fitness, from random poses, too."""

    def __init__(self, params: CrsmParams, grids: GreyMap) -> None:
        self.params = params
        self.restarts = 0
        self._map = grids
        self._rng = np.random.default_rng(params.seed)
        self.usual = 0.0
        self._finest = ROUGH if params.refine else FINEST

    def climb(self, points: ScanReader, start: Pose2, prior: Prediction) -> Match:
        """[Tsardoulias13] random restart hill climbing: the darkest pose that it finds.

        Restarts belong to the prediction; other starts are those of a search on coarse cells.
        """
        weight = (points.noise / (self.params.stroke * self.params.cell)) ** 2
        expected = *prior.pose, prior.information, weight / max(len(points.ends), 1)
        grids = tuple(map(tuple, self._map.levels))
        predicted = start == prior.pose
        length = FIRST if predicted else LONGEST
        ends, at = points.ends, tuple(start)
        best: Climbed = match_kernels.climb(grids, ends, expected, at, length, self._finest)
        if predicted and best[1] < self.params.enough * self.usual:
            best = self._restarted(grids, ends, expected, start, best)
        pose, fitness = Pose2(*best[0]), best[1]
        if self.params.refine:
            return Match(pose, fitness)
        return Match(pose, fitness, points.noise**2, points.information(pose.theta) * fitness)

    def learn(self, points: ScanReader, pose: Pose2) -> None:
        """Take the fitness of the last scan's pose for usual."""
        fitness = match_kernels.fitness_of(tuple(self._map.levels[0]), points.ends, tuple(pose))
        self.usual += (fitness - self.usual) / MEMORY

    def _restarted(
        self, grids: Any, ends: Floats, expected: Any, start: Pose2, best: Climbed
    ) -> Climbed:
        """The best climb of that so far, one with long steps, and those from random poses.

        Of these the ones that promise most.
        """
        p = self.params
        window = np.array((p.search_distance, p.search_distance, p.search_angle))
        starts = np.array(start) + self._rng.uniform(-1.0, 1.0, (p.restarts, 3)) * window
        promises = np.empty(p.restarts)
        match_kernels.promising(grids[1], ends, expected, starts, promises)
        order = np.argsort(-promises, kind="stable")[: p.climbs]
        for at in (tuple(start), *map(tuple, starts[order].tolist())):
            self.restarts += 1
            found: Climbed = match_kernels.climb(grids, ends, expected, at, LONGEST, self._finest)
            best = found if found[2] > best[2] else best
            if best[1] >= p.enough * self.usual:
                break
        return best
