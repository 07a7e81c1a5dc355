"""PoseEstimator: predicts the pose, decides which match is taken, and says how sure it is."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from slams.frontend.degeneracy import (
    FULLY_OBSERVED,
    Observability,
    match_observability,
    scan_observability,
)
from slams.frontend.filter_kernels import CONTRADICTED
from slams.frontend.motion_filter import MAP_ERROR, MotionFilter, Prediction
from slams.frontend.params import FrontendParams
from slams.frontend.ranking import Candidate, MatchedMap, Rematch, best_around, best_of
from slams.frontend.relocalize import Relocalizer
from slams.frontend.update_kernels import LATENCY
from slams.refine.lines import Match
from slams.scan.end_points import EndPoints
from slams.types import Floats, Pose2, Scan, State

ACCEPTED = 0.3  # score of a match that stands by itself, beyond the gate
USUAL = 0.85  # of the usual score; less is doubtful
MEMORY = 0.5  # s over which a score is usual
GATE = 49.0  # squared Mahalanobis distance from the prior that one scan cannot prove
REFUSED = 1.5  # times the variances after a good match beyond the gate: it may be a blunder of ours
LOST_XY, LOST_HEADING = 0.5, 0.3  # m, rad: deviation of a pose that holds no map together
CONFIRMED = (
    3.0  # s after the robot was lost, times match_score over the usual: a match has to stand
)
RELOCALIZED = np.diag((0.05**2, 0.05**2, 0.02**2))  # m^2, m^2, rad^2
BEGIN_BEAMS = 10  # end points that a map begins with
# s without a match: the whole map is searched, and scans are mapped by wheels; also without
DEAD_RECKONING, FRAGMENT = 1.0, 3.0
AGAINST = 2.0  # beams in new ground that one in conflict outweighs
IN_CONFLICT = 0.05  # share of the beams: more are not noise, but people, dust, or the floor


class PoseEstimator:
    """The pose of the robot from scan to scan; `ranking` says which match explains a scan best.

    Per scan: `predict`, then `decide`. `state` is "matched", "predicted" or "lost", `quality` the
    share of beams that are inliers, less those in conflict; `counts` counts scans.
    """

    def __init__(self, params: FrontendParams) -> None:
        self.state: State = "matched"
        self.quality = 1.0
        self.may_map = False  # whether the last scan may enter the map
        self.match: Match | None = None  # that the last pose is of
        named = "empty matched predicted lost searched relocalized in_conflict odometry gyro"
        self.counts = dict.fromkeys(named.split(), 0)
        self._p = params
        self._filter = MotionFilter(params)
        self._pose = self._filter.pose
        self._prior = self._filter.prediction()
        self._usual = 1.0  # match_score of the matches so far
        self._unmatched = 0.0  # s since the last match
        self._by_wheels = True  # all that time
        self._new_ground = 0.0  # s, all that time: share of beams in new ground less in conflict
        self._unconfirmed = 0.0  # s that matches still have to stand
        self._lost = False
        self._relocalizer = Relocalizer(params.relocate)
        self._new = 0.0  # share of its beams in new ground; unmatched, less those in conflict
        self._drift, self._drawn_at = np.zeros((3, 3)), self._pose  # of the map around that pose

    @property
    def pose(self) -> Pose2:
        """The base in the map after the last call."""
        return self._pose

    @property
    def local_covariance(self) -> Floats:
        """Covariance (3, 3) of the pose against the map around it [m^2, m rad, rad^2]."""
        return self._filter.covariance.copy()

    @property
    def covariance(self) -> Floats:
        """The same in the frame of the first scan, from which the map has drifted."""
        return self._filter.covariance + self._drift_here()

    def inserted(self, settling: bool) -> None:
        """The last scan has entered the map; new ground is where the match had it.

        ours: the first scan errs as later ones do once the map is `settling` no longer, and with it
        all that is matched. Later matches are with old and new ground, by the share of each, and
        so take over that share of this match's error.
        """
        noise = self._filter.covariance
        self._drift = noise.copy() if settling else self._drift_here() + self._new**2 * noise
        self._drawn_at = self._pose

    def _drift_here(self) -> Floats:
        """The drift (3, 3) of the map, by its heading more the farther the robot has driven on."""
        lever = np.eye(3)
        lever[0, 2], lever[1, 2] = self._drawn_at.y - self._pose.y, self._pose.x - self._drawn_at.x
        return np.asarray(lever @ self._drift @ lever.T)

    def predict(self, scan: Scan) -> Prediction:
        """The pose at `scan` as wheels, gyro and the twist so far foresee it."""
        self._scan = scan
        self._prior = self._filter.predict(scan)
        self._pose = self._prior.pose
        self.counts["odometry"] += self._filter.wheels
        self.counts["gyro"] += self._filter.gyro
        return self._prior

    def twist_at(self, pose: Pose2) -> Pose2:
        """The body twist if the robot is at `pose` [m/s, rad/s]."""
        return self._filter.twist_at(pose)

    def place(self, scan: Scan, pose: Pose2) -> None:
        """The pose of a scan is known without matching."""
        self._filter.predict(scan)
        self._filter.place(pose, np.diag(MAP_ERROR**2))
        self._pose = pose

    def correct(self, pose: Pose2) -> None:
        """The map has changed, and the robot is at `pose` in it; it moves as before."""
        self._filter.shift(pose)
        self._pose = pose

    def decide(
        self, points: EndPoints, matches: Sequence[Match], grid: MatchedMap, rematch: Rematch
    ) -> Pose2:
        """Take one of the matches, or none, and return the pose."""
        self.match = None
        if grid.empty:
            return self._begin(points)
        if points.n == 0:
            self.counts["empty"] += 1
            return self._miss(None, points, grid)
        best = best_of(matches, points, grid, self._prior)
        if self._p.search and (best.distance > GATE or not self._is_usual(best)):
            self.counts["searched"] += 1
            best = best_around(best.match, points, grid, self._prior, rematch)
        settle = self._take if self._accepts(best, points, grid) else self._miss
        return settle(best, points, grid)

    # decide

    def _is_usual(self, candidate: Candidate) -> bool:
        return candidate.match_score >= USUAL * self._usual

    def _accepts(self, best: Candidate, points: EndPoints, grid: MatchedMap) -> bool:
        if self._unconfirmed > 0.0 and self._is_usual(best):
            return True
        is_doubtful = best.conflicts > IN_CONFLICT and best.distance > CONTRADICTED
        if is_doubtful and not self._leads(0.0, best, points, grid):
            return False  # in a crowd or in smoke any pose explains as much, or as little
        if best.distance > GATE and not self._is_near(best, points, grid):
            if best.score >= ACCEPTED:
                self._filter.widen(REFUSED)
            return False
        if self._lost and best.score < ACCEPTED and not self._is_usual(best):
            return False  # in so wide a prior chance explains a little of any scan
        return best.match_score > 0.0  # more of the beams are for it than against it

    def _is_near(self, best: Candidate, points: EndPoints, grid: MatchedMap) -> bool:
        """Whether a match beyond the gate explains the scan, as near as a late scan may be.

        Along what is not observed every place is as good.
        """
        if best.seconds > LATENCY:
            return False
        if not self._is_usual(best) and not self._leads(ACCEPTED, best, points, grid):
            return False
        return best.seconds <= self._prior.dt or self._observed(points, best.match).share > 0.0

    def _leads(self, by: float, best: Candidate, points: EndPoints, grid: MatchedMap) -> bool:
        """Whether the score of a match is above `by`, and so much above the prediction's."""
        if best.score <= by:
            return False
        inliers, conflicts = grid.evaluate(points, self.pose)
        return best.score - (inliers - conflicts) > by

    def _observed(self, points: EndPoints, match: Match) -> Observability:
        if not self._p.degeneracy:
            return FULLY_OBSERVED
        by_scan = scan_observability(points, match.pose.theta, self._filter.wheels)
        by_match = match_observability(match.information)
        return by_match if by_match.share < by_scan.share else by_scan

    def _begin(self, points: EndPoints) -> Pose2:
        """The first scan with enough to see begins the map."""
        self.may_map = points.n >= BEGIN_BEAMS
        if self.may_map:
            self._filter.shift(self.pose)
        self._call("matched" if self.may_map else "predicted" if self._is_sure() else "lost")
        return self.pose

    def _take(self, best: Candidate, points: EndPoints, grid: MatchedMap) -> Pose2:
        """The robot is at a match."""
        match, match_score = best.match, best.match_score
        self.match, self._new = match, 1.0 - best.inliers - best.conflicts
        self.counts["in_conflict"] += best.conflicts > IN_CONFLICT
        if best.distance > GATE and best.seconds > self._prior.dt:
            self._filter.shift(match.pose)  # not driven there: a scan that was kept back
            self._pose = match.pose
        else:
            seen = self._observed(points, match)
            self._pose = self._filter.update(match.pose, match.information, seen)
        share = min(1.0, self._prior.dt / MEMORY)
        if self._is_usual(best):
            self._unconfirmed = 0.0
        elif self._unconfirmed <= 0.0 and (self._lost or self._refuted):
            self._unconfirmed = CONFIRMED
        else:
            self._unconfirmed -= self._prior.dt * match_score / self._usual
        if self._unconfirmed <= 0.0:
            self._usual += share * (match_score - self._usual)
        self._lost = False
        self.quality = max(match_score, 0.0)
        self.may_map = self._unconfirmed <= 0.0
        held = self.may_map or self._by_wheels
        settled: State = "matched" if self.may_map else "predicted"
        self._call(settled if held and self._is_sure() else "lost")
        if self.may_map:
            self._unmatched, self._by_wheels, self._new_ground = 0.0, True, 0.0
            self._relocalizer.reset()
        else:  # what explains so little may be another place
            self._unmatched += self._prior.dt
            self._relocalize(grid)
        return self.pose

    def _miss(self, best: Candidate | None, points: EndPoints, grid: MatchedMap) -> Pose2:
        """No match: the pose is the prediction. Mapping goes on where that does no harm."""
        self._unmatched += self._prior.dt
        self._by_wheels &= self._filter.wheels
        new = self._share_of_new_ground(points, grid)
        self._new = max(new, 0.0)
        self._new_ground += self._prior.dt * new
        doubtful = self._refuted or self._unconfirmed > 0.0
        self._lost |= (doubtful and not self._by_wheels) or not self._is_sure()
        if self._unconfirmed > 0.0:
            self._unconfirmed = CONFIRMED
        self.quality = max(best.match_score, 0.0) if best else 0.0
        self.may_map = new > 0.0 and self._maps_unmatched()
        self._call("lost" if self._lost else "predicted")
        if self._lost or self._refuted:
            self._relocalize(grid)
        return self.pose

    @property
    def _refuted(self) -> bool:
        """Whether the map contradicts the prediction for long: a crowd, or it was lifted."""
        return self._unmatched > DEAD_RECKONING and self._new_ground < 0.0

    def _share_of_new_ground(self, points: EndPoints, grid: MatchedMap) -> float:
        """Share of beams that end in new ground, less `AGAINST` times those in conflict."""
        if points.n == 0:
            return 0.0
        inliers, conflicts = grid.evaluate(points, self.pose)
        return 1.0 - inliers - conflicts - AGAINST * conflicts

    def _maps_unmatched(self) -> bool:
        """Whether unmatched scans enter the map: else a robot in new ground never matches."""
        return self._unmatched > (DEAD_RECKONING if self._by_wheels else FRAGMENT)

    def _relocalize(self, grid: MatchedMap) -> None:
        """Global localization in the map; a pose that wheels contradict is none."""
        if self._unmatched < DEAD_RECKONING:
            return
        variance = max(self._filter.covariance.diagonal()[:2].tolist())
        held = self._by_wheels and not self._refuted
        reach = math.sqrt(GATE * variance) if held else math.inf
        found = self._relocalizer.update(self._scan, self.pose, reach, grid.crop)
        if found is None or (held and self._prior.distance(found) > GATE):
            return
        self._filter.place(found, RELOCALIZED)
        self._pose = found
        self.counts["relocalized"] += 1
        self._unconfirmed, self._unmatched, self._lost = 0.0, 0.0, False

    def _is_sure(self) -> bool:
        xx, yy, turn = self._filter.covariance.diagonal().tolist()
        return bool(xx + yy < LOST_XY**2 and turn < LOST_HEADING**2)

    def _call(self, state: State) -> None:
        self.state = state
        self.counts[state] += 1
