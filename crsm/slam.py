"""CRSM SLAM: a few critical rays matched against one global map by hill climbing.

[Tsardoulias13] E. Tsardoulias, L. Petrou: "Critical Rays Scan Match SLAM", Journal of Intelligent
& Robotic Systems 72, 2013. One scan after the other:

1. clean the ranges and choose the critical rays: few beams that fix x, y and theta;
2. climb from the start pose to where the map under the ends of these rays is darkest,
   restarting at random;
3. add the step to the pose;
4. draw the scan into the global map.

The default adds a prediction (1b) and a least squares fit of all beams to walls with sub-cell
position (3), and makes the search (2) only when that fit is poor. `crsm@original` is the published
program as it was, see `published.py`.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from crsm.match_kernels import fitness, normal_equations, restart_hill_climb
from crsm.motion import Motion
from crsm.params import CrsmParams
from crsm.published import Published
from crsm.reader import ScanReader
from crsm.walls import WallGrid
from slams.params import Params
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan

MEMORY = 0.05  # weight of one scan in the usual quality
FIT_ROUNDS, FIT_STEP, FIT_TURN = 20, 1e-4, 3e-5  # 1, m, rad
UPPER = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])  # where H stands in its upper triangle
CLIMB_STEPS = (0.05, 0.02)  # m, rad
AGREED, AGREED_TURN = 0.5, 0.01  # cells, rad between predictions that need no choice


class Crsm:
    """The default program; with the preset `original`, the face of the published one."""

    Params: ClassVar[type[Params]] = CrsmParams

    def __init__(self, params: CrsmParams) -> None:
        self.params = params
        self.pose = IDENTITY
        self.quality = 0.0
        self._published = Published(params) if params.program == "published" else None
        self._map = WallGrid(params)
        self._motion = Motion()
        self._rng = np.random.default_rng(params.seed)
        self._reader: ScanReader | None = None
        self._usual_quality = 0.0
        self._information = np.zeros((3, 3))
        self._drawn_at = IDENTITY
        self._undrawn = self._misses = 0
        names = ("inserted", "rejected", "lost", "recovered", "searched", "restarts", "faded")
        self._counts = dict.fromkeys(names, 0)

    def update(self, scan: Scan) -> Pose2:
        """Take the next scan; return the base's pose in the map, T_map_base."""
        if self._published:
            return self._published.update(scan)
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
        return self._published.grid() if self._published else self._map.occupancy()

    def report(self) -> dict[str, Any]:
        """Counts of what happened so far."""
        if self._published:
            return dict(self._published.counts)
        return self._counts | self._motion.counts

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the last fit in m and rad, the prior included."""
        h = self._information
        return np.asarray(np.linalg.inv(h)) if h.any() else np.zeros((3, 3))

    def _read(self, scan: Scan) -> ScanReader:
        """Step 1: end points on walls and critical rays, without the motion during the scan."""
        if self._reader is None or self._reader.laser != scan.laser:
            self._reader = ScanReader(self.params, scan.laser)
        self._reader.read(scan, self._motion.velocity)
        return self._reader

    def _seen_again(self, scan: Scan, pose: Pose2) -> tuple[ScanReader, Floats]:
        """Step 1 again with the velocity that was found, and that pose as the start."""
        assert self._reader is not None
        velocity = self._motion.velocity_of(self.pose.between(pose), scan)
        self._reader.read(scan, velocity)
        return self._reader, np.array([*(pose @ scan.laser.mount), 0.0])

    def _start(self, view: ScanReader, predictions: list[Pose2]) -> Floats:
        """Step 2, first guess: the prediction whose critical rays fit best, if they differ."""
        starts = [pose @ view.laser.mount for pose in predictions]
        apart = np.abs(np.array(predictions) - predictions[0]).max(axis=0)
        if max(apart[:2]) < AGREED * self.params.cell and apart[2] < AGREED_TURN:
            return np.array([*starts[0], 0.0])
        fits = [self._fitness(view, pose) for pose in starts]
        best = int(np.argmax(fits))
        return np.array([*starts[best], fits[best]])

    def _search(self, view: ScanReader, start: Floats) -> None:
        """Step 2, random restart hill climbing; `start` (4,) becomes the best pose found."""
        p = self.params
        reach = np.array([p.search_distance, p.search_distance, p.search_angle])
        draws = self._rng.uniform(-1.0, 1.0, (p.restarts, 3)) * reach
        rules = (*CLIMB_STEPS, p.enough)
        cells, points = self._map.cells, view.points
        used = restart_hill_climb(cells, points, view.rays, len(view.rays), draws, rules, start)
        self._counts["searched"] += 1
        self._counts["restarts"] += used

    def _fit(self, view: ScanReader, start: Floats) -> tuple[Pose2, float]:
        """Step 3: all beams to the walls; a poor fit is tried again from a thorough search.

        Returns the base's pose and the quality 0..1.
        """
        best = self._fitted(view, start)
        if best[1] < self.params.search_below * self._usual_quality:
            self._search(view, start)
            other = self._fitted(view, start)
            best = other if other[1] > best[1] else best
        pose, quality, self._information = best
        return Pose2(*pose.tolist()) @ view.laser.mount.inverse(), quality

    def _fitted(self, view: ScanReader, start: Floats) -> tuple[Floats, float, Floats]:
        """Gauss-Newton; returns the laser's pose (3,), quality 0..1 and information (3, 3)."""
        p = self.params
        noise2, lone2 = p.range_noise**2, p.lone_noise**2
        rules = (p.gate, p.compat, noise2, lone2, p.lean**2, p.robust**2, p.agreement**2)
        prior = np.diag([p.prior**-2, p.prior**-2, p.prior_turn**-2])
        pose, system = start[:3].copy(), np.zeros(10)
        for _ in range(FIT_ROUNDS):
            at = (float(pose[0]), float(pose[1]), float(pose[2]))
            normal_equations(self._map.cells, view.points, view.m, at, rules, system)
            h = system[UPPER] + prior
            step = np.linalg.solve(h, system[6:9] + prior @ (pose - start[:3]))
            pose -= step
            if max(abs(step[:2])) < FIT_STEP and abs(step[2]) < FIT_TURN:
                break
        return pose, float(system[9]) / view.m, h

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
        """Step 4: walls from every trusted scan, grey levels where the robot has moved on."""
        if not view.is_usable or 0 < self._misses <= self.params.patience:
            self._counts["rejected"] += 1
            return
        at = self.pose @ view.laser.mount
        if not self._map.insert(view.points, view.m, at, view.reach):
            self._counts["rejected"] += 1
            return
        self._counts["inserted"] += 1
        self._undrawn += 1
        step = self._drawn_at.between(self.pose)
        moved = max(math.hypot(step.x, step.y), abs(step.theta)) >= self.params.draw_step
        if moved or self._undrawn >= self.params.draw_rest or self._counts["inserted"] == 1:
            self._counts["faded"] += self._map.draw(view.points, view.m, at)
            self._drawn_at, self._undrawn = self.pose, 0
