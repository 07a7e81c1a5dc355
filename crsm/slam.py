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

from crsm.fitter import Belief, Fit, Fitter
from crsm.map import WallGrid
from crsm.match_kernels import restart_hill_climb
from crsm.pace import Pace
from crsm.params import CrsmParams
from crsm.scan import ScanReader
from slams.motion.chord import FLOOR
from slams.motion.model import Motion, Prediction
from slams.motion.trust import Limits
from slams.params import Params
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan

MEMORY = 0.05  # weight of one scan in the usual quality
CLIMB_STEPS = (0.05, 0.02)  # m, rad
MOST_SURPRISE, SURPRISE_MEMORY = 1000.0, 0.02  # of one fit, its weight in the usual surprise
LOST_AFTER = 1.0  # s without a scan that the map explains: a robot is elsewhere by then
NEW_GROUND = 0.5  # m on wheels without a match: what is seen there is new, not foreign
EASED = 4.0  # of a prior's covariance that fits made, not wheels: it would confirm itself
PAUSE = 0.5  # s between two searches of a lost robot


class Crsm:
    """Critical rays, and all beams fitted to walls; see the module for the steps.

    After each scan: `pose`, its `covariance` (3, 3) [m, rad] in the map, `quality` 0..1 of the fit
    and `state`, "matched", "predicted" (the map did not explain the scan) or "lost".
    """

    Params: ClassVar[type[Params]] = CrsmParams

    def __init__(self, params: CrsmParams) -> None:
        self.params = params
        self.pose = IDENTITY
        self.quality = 0.0
        self.state = "predicted"
        self.covariance: Floats = FLOOR * np.eye(3)  # the first pose is the map's frame
        self._map = WallGrid(params)
        self._fitter = Fitter(params)
        self._motion, self._limits = Motion(params), Limits(params)
        self._rng = np.random.default_rng(params.seed)
        self._reader: ScanReader | None = None
        self._usual_quality, self._surprise = 0.0, 1.0
        self._unmatched = self._unsearched = self._carried = 0.0  # s, s, m
        self._inserted = Pace(params.insert_step, params.insert_rest)
        self._drawn = Pace(params.draw_step, params.draw_rest)
        names = ("inserted", "rejected", "lost", "recovered", "searched", "restarts", "faded")
        self._counts = dict.fromkeys(names, 0)

    def update(self, scan: Scan) -> Pose2:
        """Take the next scan; return the base's pose in the map, T_map_base."""
        p = self._motion.predict(self.pose, scan)  # 1b
        view = self._read(scan, p.velocity)  # 1
        belief = Belief(p.pose, p.pose_covariance(self.covariance))
        self.pose, self.covariance = belief.pose, belief.covariance
        self.quality, fit = 0.0, None
        if view.is_usable and not self._map.is_empty:
            eased = self._surprise if "wheels" in p.used else EASED
            prior = belief._replace(eased=eased).moved(p.pose @ view.laser.mount)
            fit = self._found(view, p, prior)  # 2, 3
            if view.sweeps:
                at = fit.belief.pose
                self._read(scan, self._motion.velocity_to(at @ view.laser.mount.inverse()))
                fit = self._fitter.fit(self._map, view, at, fit.prior)
            self.quality = fit.quality
        if self._judge(p, view, fit):
            match = self._settle(view, fit)
            self._motion.moved(self.pose, match, scan)
        else:
            self._motion.missed(scan)
        self._insert(view)  # 4
        return self.pose

    def map(self) -> OccupancyGrid:
        """The grey levels of the map as probabilities."""
        return self._map.occupancy()

    def report(self) -> dict[str, Any]:
        """Counts of what happened so far."""
        return self._counts | self._motion.counts | self._map.extent.counts

    def _read(self, scan: Scan, velocity: Pose2) -> ScanReader:
        """Step 1: end points on walls and critical rays, without the motion during the scan."""
        if self._reader is None or self._reader.laser != scan.laser:
            self._reader = ScanReader(self.params, scan.laser)
        self._reader.read(scan, velocity)
        return self._reader

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

    def _found(self, view: ScanReader, p: Prediction, prior: Belief) -> Fit:
        """Step 3: all beams to the walls; a poor fit is tried again from other starts (step 2)."""
        best = self._fitter.fit(self._map, view, prior.pose, prior)
        self._unsearched += p.dt
        usual = self.params.search_below * self._usual_quality
        if best.quality >= usual or (self.state == "lost" and self._unsearched < PAUSE):
            return best
        self._unsearched = 0.0
        wide, charge = self._widened(prior)
        going_on = p.pose @ p.step.inverse() @ p.continued @ view.laser.mount
        for start in (going_on, self._search(view, prior.pose)):
            other = self._fitter.fit(self._map, view, start, wide)
            other = other._replace(cost=other.cost + charge)
            explains = other.quality >= usual  # else it is no better founded
            best = other if explains and other.cost < best.cost else best
        return best

    def _widened(self, prior: Belief) -> tuple[Belief, float]:
        """The prior of a robot that is not where it is predicted, and what that costs.

        A pose found by search pays for its distance from the prediction in units of this
        covariance, and for how wide it is.
        """
        reach = 0.5 * np.array([self.params.search_distance] * 2 + [self.params.search_angle])
        wide = prior.covariance + np.diag(reach**2)
        charge = np.linalg.slogdet(wide)[1] - np.linalg.slogdet(prior.covariance)[1]
        return prior._replace(covariance=wide), 0.5 * float(charge)

    def _judge(self, p: Prediction, view: ScanReader, fit: Fit | None) -> bool:
        """Whether the map explains the scan from where the robot can be, and for how long not."""
        if self._map.is_empty and view.is_usable:
            self.state = "matched"
            return True
        if fit is not None and self._explains(p, view, fit):
            self._counts["recovered"] += self.state == "lost"
            self.state, self._unmatched, self._carried = "matched", 0.0, 0.0
            return True
        self._unmatched += p.dt
        self._carried += math.hypot(p.step.x, p.step.y) if "wheels" in p.used else 0.0
        self.state = "lost" if self._unmatched > LOST_AFTER else "predicted"
        self._counts["lost"] += self.state == "lost"
        return False

    def _explains(self, p: Prediction, view: ScanReader, fit: Fit) -> bool:
        off = (p.pose @ view.laser.mount).between(fit.belief.pose)
        possible = self._limits.allow(*off, self._unmatched + p.dt)
        return possible and fit.quality >= self.params.lost_below * self._usual_quality

    def _settle(self, view: ScanReader, fit: Fit | None) -> Floats | None:
        """Take the fit's pose, learn what is usual; the covariance of the match alone."""
        if fit is None:
            return None
        base = fit.belief.pose @ view.laser.mount.inverse()
        self.pose, self.covariance, _ = fit.belief.moved(base)
        weight = MEMORY if self._usual_quality > 0.0 else 1.0
        self._usual_quality += weight * (self.quality - self._usual_quality)
        self._fitter.learn(fit)
        surprise = min(fit.surprise, MOST_SURPRISE) - self._surprise
        self._surprise = max(self._surprise + SURPRISE_MEMORY * surprise, 1.0)
        return fit.alone.moved(base).covariance

    def _enters(self, view: ScanReader) -> bool:
        """Whether the scan may enter the map: explained, or of ground that only wheels know."""
        if view.is_usable and self._carried > NEW_GROUND:
            self.state, self._unmatched, self._carried = "predicted", 0.0, 0.0
            return True
        return view.is_usable and self.state == "matched"

    def _insert(self, view: ScanReader) -> None:
        """Step 4: walls and grey levels, each where the robot has moved on or waited."""
        if not self._enters(view):
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
