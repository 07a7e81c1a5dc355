"""CRSM SLAM: a few critical rays matched against one global map by hill climbing.

[Tsardoulias13] E. Tsardoulias, L. Petrou: "Critical Rays Scan Match SLAM", Journal of Intelligent
& Robotic Systems 72, 2013. One scan after the other:

1. clean the ranges and choose the critical rays: few beams that fix x, y and theta;
2. climb from the start pose to where the map under the ends of these rays is darkest,
   restarting at random;
3. add the step to the pose;
4. draw the scan into the global map.

The default adds a prediction (1b) and a least squares fit of all beams to walls with sub-cell
position (3), and makes the search (2) only when that fit is poor. The published program as it was,
`crsm@original`, stands in `original`.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from crsm.fitter import Fitter, Upper
from crsm.map import WallGrid
from crsm.match_kernels import fitness, restart_hill_climb
from crsm.motion import Motion, Pace
from crsm.params import CrsmParams
from crsm.scan import ScanReader
from slams.params import Params
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan

MEMORY = 0.05  # weight of one scan in the usual quality
CLIMB_STEPS = (0.05, 0.02)  # m, rad
AGREED, AGREED_TURN = 0.5, 0.01  # cells, rad between predictions that need no choice


class Crsm:
    """Critical rays, and all beams fitted to walls; see the module for the steps."""

    Params: ClassVar[type[Params]] = CrsmParams

    def __init__(self, params: CrsmParams) -> None:
        self.params = params
        self.pose = IDENTITY
        self.quality = 0.0
        self._map = WallGrid(params)
        self._fitter = Fitter(params)
        self._motion = Motion()
        self._rng = np.random.default_rng(params.seed)
        self._reader: ScanReader | None = None
        self._usual_quality = 0.0
        self._information: Upper | None = None
        self._inserted = Pace(params.insert_step, params.insert_rest)
        self._drawn = Pace(params.draw_step, params.draw_rest)
        self._misses = 0
        names = ("inserted", "rejected", "lost", "recovered", "searched", "restarts", "faded")
        self._counts = dict.fromkeys(names, 0)

    def update(self, scan: Scan) -> Pose2:
        """Take the next scan; return the base's pose in the map, T_map_base."""
        view = self._read(scan)  # 1
        predictions = self._motion.predictions(self.pose, scan)  # 1b
        pose = predictions[0] if self._motion.is_measured else self.pose
        if view.is_usable and not self._map.is_empty:
            start = self._start(view, predictions)  # 2
            fitted, self.quality = self._fit(view, start)  # 3
            if view.sweeps:
                fitted, self.quality = self._fit(*self._seen_again(scan, fitted))
            pose = fitted if self._is_trusted(fitted) else pose
        self._motion.moved(self.pose.between(pose), scan)
        self.pose = pose
        self._insert(view)  # 4
        return pose

    def map(self) -> OccupancyGrid:
        """The grey levels of the map as probabilities."""
        return self._map.occupancy()

    def report(self) -> dict[str, Any]:
        """Counts of what happened so far."""
        return self._counts | self._motion.counts | self._map.extent.counts

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the last fit in m and rad, the prior included."""
        if self._information is None:
            return np.zeros((3, 3))
        xx, xy, xt, yy, yt, tt = self._information
        return np.asarray(np.linalg.inv([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]]))

    def _read(self, scan: Scan) -> ScanReader:
        """Step 1: end points on walls and critical rays, without the motion during the scan."""
        if self._reader is None or self._reader.laser != scan.laser:
            self._reader = ScanReader(self.params, scan.laser)
        self._reader.read(scan, self._motion.velocity)
        return self._reader

    def _seen_again(self, scan: Scan, pose: Pose2) -> tuple[ScanReader, Pose2]:
        """Step 1 again with the velocity that was found, and that pose as the start."""
        assert self._reader is not None
        velocity = self._motion.velocity_of(self.pose.between(pose), scan)
        self._reader.read(scan, velocity)
        return self._reader, pose @ scan.laser.mount

    def _start(self, view: ScanReader, predictions: list[Pose2]) -> Pose2:
        """Step 2, first guess: the prediction whose critical rays fit best, if they differ."""
        starts = [pose @ view.laser.mount for pose in predictions]
        if self._agree(predictions):
            return starts[0]
        fits = [self._fitness(view, pose) for pose in starts]
        return starts[fits.index(max(fits))]

    def _agree(self, predictions: list[Pose2]) -> bool:
        """They are so close that the fit makes up for it."""
        first, near = predictions[0], AGREED * self.params.cell
        return all(
            max(abs(p.x - first.x), abs(p.y - first.y)) < near
            and abs(p.theta - first.theta) < AGREED_TURN
            for p in predictions
        )

    def _search(self, view: ScanReader, start: Pose2) -> Pose2:
        """Step 2, random restart hill climbing: the best pose found."""
        p = self.params
        reach = np.array([p.search_distance, p.search_distance, p.search_angle])
        draws = self._rng.uniform(-1.0, 1.0, (p.restarts, 3)) * reach
        rules = (*CLIMB_STEPS, p.enough)
        cells, points, best = self._map.cells, view.points, np.array([*start, 0.0])
        used = restart_hill_climb(cells, points, view.rays, len(view.rays), draws, rules, best)
        self._counts["searched"] += 1
        self._counts["restarts"] += used
        return Pose2(*best[:3].tolist())

    def _fit(self, view: ScanReader, start: Pose2) -> tuple[Pose2, float]:
        """Step 3: all beams to the walls; a poor fit is tried again from a thorough search.

        Returns the base's pose and the quality 0..1.
        """
        best = self._fitter.fit(self._map, view, start)
        if best.quality < self.params.search_below * self._usual_quality:
            other = self._fitter.fit(self._map, view, self._search(view, start))
            best = other if other.quality > best.quality else best
        self._information = best.information
        return best.pose @ view.laser.mount.inverse(), best.quality

    def _fitness(self, view: ScanReader, pose: Pose2) -> float:
        cells, rays = self._map.cells, view.rays
        return float(fitness(cells, view.points, rays, len(rays), tuple(pose)))

    def _is_trusted(self, pose: Pose2) -> bool:
        """Whether the fit may move the pose and enter the map; learns what is usual from it."""
        good = self.quality >= self.params.lost_below * self._usual_quality
        good = good and all(map(math.isfinite, pose))
        if not good:
            self._counts["lost"] += self._misses == 0
            self._misses += 1
            return False
        self._counts["recovered"] += self._misses > 0
        self._misses = 0
        weight = MEMORY if self._usual_quality > 0.0 else 1.0
        self._usual_quality += weight * (self.quality - self._usual_quality)
        return True

    def _insert(self, view: ScanReader) -> None:
        """Step 4: walls and grey levels, each where the robot has moved on or waited."""
        if not view.is_usable or 0 < self._misses <= self.params.patience:
            self._counts["rejected"] += 1
            return
        draw_due = self._drawn.is_due(self.pose)
        if not (self._inserted.is_due(self.pose) or draw_due):
            return
        at = self.pose @ view.laser.mount
        if not self._map.insert(view.points, view.m, at, view.reach):
            self._counts["rejected"] += 1
            return
        self._inserted.done(self.pose)
        self._counts["inserted"] += 1
        if draw_due:
            self._counts["faded"] += self._map.draw(view.points, view.m, at)
            self._drawn.done(self.pose)
