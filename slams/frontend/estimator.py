"""PoseEstimator: predicts the pose, decides which match is accepted, and estimates covariances."""

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
from slams.frontend.filter_kernels import MIN_MATCH_STD, NIS_GATE
from slams.frontend.motion_filter import MotionFilter, Prediction
from slams.frontend.params import FrontendParams
from slams.frontend.ranking import (
    MAX_ROBOT_SPEED,
    Candidate,
    MatchedMap,
    Rematch,
    best_around,
    best_of,
)
from slams.frontend.relocalize import Relocalizer
from slams.frontend.update_kernels import MAX_SCAN_DELAY
from slams.refine.lines import Match
from slams.scan.end_points import EndPoints
from slams.types import Floats, Pose2, Scan, State

MATCH_GATE = 49.0  # squared Mahalanobis distance from the prior, seven deviations
MIN_RELIABLE_SCORE = 0.3  # beyond the gate or when lost: chance fits a little of any scan
NEAR_MATCH_TIME = 0.125  # s of a robot's motion (0.25 m or rad) from the prediction to a match
MIN_SCORE_RATIO = 0.85  # of a match score to the mean; below it a match is doubtful
SCORE_AVERAGING_TIME = 0.5  # s
REJECTION_INFLATION = 1.5  # of the variances, by a good match beyond the gate: the prior may be off
LOST_POSITION_STD, LOST_HEADING_STD = 0.5, 0.3  # m, rad; with more the map would be inconsistent
CONFIRMATION_TIME = 3.0  # s that matches must persist after the robot was lost, at the mean score
RELOCALIZED_COVARIANCE = np.diag((0.05**2, 0.05**2, 0.02**2))  # m^2, m^2, rad^2
MIN_FIRST_POINTS = 10  # end points of the scan that starts a map
# s without a match, until relocalization starts and scans enter the map by wheels; by laser alone
MAX_UNMATCHED_TIME, MAX_UNMATCHED_TIME_LASER_ONLY = 1.0, 3.0
MIN_SHARE_AGAINST_WHEELS = 0.5  # observed along the worst direction; below it is mostly noise
CONFLICT_WEIGHT = 3.0  # beams in new ground that one beam in conflict outweighs
MAX_NOISE_CONFLICTS = 0.05  # share of the beams; more are people, smoke or the floor


class PoseEstimator:
    """The pose of the robot from scan to scan.

    Per scan: `predict`, then `decide`. `state` is "matched", "predicted" or "lost", `quality` the
    share of beams that are inliers, less those in conflict; `counts` counts scans, and has
    the delay of their stamps against wheels and gyro [ms].
    """

    def __init__(self, params: FrontendParams) -> None:
        self.state: State = "matched"
        self.quality = 1.0
        self.may_map = False  # whether the last scan may enter the map
        self.match: Match | None = None  # the accepted match of the last scan
        names = "empty matched predicted lost searched relocalized in_conflict odometry gyro"
        self.counts = dict.fromkeys([*names.split(), "stamps_late_ms"], 0)
        self._p = params
        self._filter = MotionFilter(params)
        self.pose = self._filter.pose  # of the base in the map, after the last call
        self._prior = self._filter.prediction()
        # moving average of the match score; before the first match 1, so that it is searched for
        self._mean_score, self._has_matched = 1.0, False
        self._unmatched_time = 0.0  # s since the last match
        self._has_odometry = True  # whether wheels measured the motion since then
        self._new_ground_time = 0.0  # s, integral since then of the share in new ground
        self._tentative_time = 0.0  # s until matches are confirmed
        self._lost = False
        self._relocalizer = Relocalizer()
        self._new_share = 0.0  # of the last scan's beams in new ground; unmatched: less conflicts
        self._map_drift, self._drift_pose = np.zeros((3, 3)), self.pose  # of the map at that pose

    @property
    def local_covariance(self) -> Floats:
        """Covariance (3, 3) of the pose relative to the map around it [m^2, m rad, rad^2]."""
        return self._filter.covariance.copy()

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the pose in the frame of the first scan, with the map's drift."""
        return self._filter.covariance + self._local_drift()

    def inserted(self, settling: bool) -> None:
        """Add the error of the last scan's pose to the drift of the map, where it was inserted.

        ours: once the map is no longer `settling`, the first scans have the error of a typical
        scan. Later matches are against old and new ground in proportion to the beams on each, and
        so the share on new ground has the error of the match that inserted it.
        """
        noise, share = self._filter.covariance, self._new_share
        self._map_drift = noise.copy() if settling else self._local_drift() + share**2 * noise
        self._drift_pose = self.pose

    def _local_drift(self) -> Floats:
        """Drift (3, 3) of the map at the pose; its heading error acts over the distance driven."""
        origin, lever = self._drift_pose, np.eye(3)
        lever[0, 2], lever[1, 2] = origin.y - self.pose.y, self.pose.x - origin.x
        return np.asarray(lever @ self._map_drift @ lever.T)

    def predict(self, scan: Scan) -> Prediction:
        """Predict the pose at `scan` by wheels, gyro and twist."""
        self._scan = scan
        self._prior = self._filter.predict(scan)
        self.pose = self._prior.pose
        self.counts["odometry"] += self._filter.wheels
        self.counts["gyro"] += self._filter.gyro
        self.counts["stamps_late_ms"] = round(1e3 * self._filter.delay)
        return self._prior

    def twist_at(self, pose: Pose2) -> Pose2:
        """The body twist [m/s, rad/s] if the robot is at `pose`."""
        return self._filter.twist_at(pose)

    def set_pose(self, scan: Scan, pose: Pose2) -> None:
        """Take a pose that is given with its scan."""
        self._filter.predict(scan)
        self._filter.set_pose(pose, np.diag(MIN_MATCH_STD**2))
        self.pose = pose

    def correct(self, pose: Pose2) -> None:
        """Take a pose in a map that has changed; the motion stays."""
        self._filter.shift(pose)
        self.pose = pose

    def decide(
        self, points: EndPoints, matches: Sequence[Match], grid: MatchedMap, rematch: Rematch
    ) -> Pose2:
        """Accept one of the matches, or none, and return the pose."""
        self.match = None
        if grid.empty:
            return self._start_map(points)
        if points.n == 0:
            self.counts["empty"] += 1
            return self._dead_reckon(None, points, grid)
        best = best_of(matches, points, grid, self._prior)
        # a match converges to the nearest walls, and these may not be the walls that were scanned
        is_near = best.seconds <= NEAR_MATCH_TIME
        if self._p.search and not (is_near and self._is_typical(best)):
            self.counts["searched"] += 1
            best = best_around(best.match, points, grid, self._prior, rematch)
        settle = self._accept if self._is_acceptable(best, points, grid) else self._dead_reckon
        return settle(best, points, grid)

    # decide

    def _is_typical(self, candidate: Candidate) -> bool:
        return candidate.match_score >= MIN_SCORE_RATIO * self._mean_score

    def _is_acceptable(self, best: Candidate, points: EndPoints, grid: MatchedMap) -> bool:
        if self._tentative_time > 0.0 and self._is_typical(best):
            return True
        # among people or in smoke the match score hardly depends on the pose
        is_doubtful = best.conflicts > MAX_NOISE_CONFLICTS and best.mahalanobis_squared > NIS_GATE
        is_refused = is_doubtful and not self._has_lead(best, points, grid)
        is_beyond_gate = best.mahalanobis_squared > MATCH_GATE
        if is_refused or (is_beyond_gate and not self._within_motion_bound(best, points, grid)):
            if best.score >= MIN_RELIABLE_SCORE:
                self._filter.inflate(REJECTION_INFLATION)
            return False
        if self._lost and best.score < MIN_RELIABLE_SCORE:
            return False
        return best.match_score > 0.0

    def _within_motion_bound(self, best: Candidate, points: EndPoints, grid: MatchedMap) -> bool:
        """Whether a match beyond the gate fits well, and a scan can be so late.

        The first match has no mean to be compared with: robots start fast, into new ground. Along a
        degenerate direction only the motion since the last scan is accepted, and a farther shift
        against wheels only if all directions are observed well.
        """
        least = MIN_SCORE_RATIO * self._mean_score if self._has_matched else MIN_RELIABLE_SCORE
        if best.seconds > MAX_SCAN_DELAY or best.match_score < least:
            return False
        if best.seconds <= self._prior.dt:
            return True
        shift = math.hypot(best.match.pose.x - self.pose.x, best.match.pose.y - self.pose.y)
        is_against_wheels = self._prior.wheels and shift > MAX_ROBOT_SPEED * self._prior.dt
        least_share = MIN_SHARE_AGAINST_WHEELS if is_against_wheels else 0.0
        return self._observability(points, best.match).share > least_share

    def _has_lead(self, best: Candidate, points: EndPoints, grid: MatchedMap) -> bool:
        """Whether the score of a match exceeds 0 and that of the predicted pose."""
        inliers, conflicts = grid.evaluate(points, self.pose)
        return best.score > max(0.0, inliers - conflicts)

    def _observability(self, points: EndPoints, match: Match) -> Observability:
        if not self._p.degeneracy:
            return FULLY_OBSERVED
        by_scan = scan_observability(points, match.pose.theta, self._filter.wheels)
        by_match = match_observability(match.information)
        return by_match if by_match.share < by_scan.share else by_scan

    def _start_map(self, points: EndPoints) -> Pose2:
        """Start the map with the first scan that has enough end points."""
        self.may_map = points.n >= MIN_FIRST_POINTS
        if self.may_map:
            self._filter.shift(self.pose)
        self._set_state(self.may_map, lost=not (self.may_map or self._has_low_variance()))
        return self.pose

    def _accept(self, best: Candidate, points: EndPoints, grid: MatchedMap) -> Pose2:
        """Update the filter with a match, and confirm it after the robot was lost."""
        match, match_score = best.match, best.match_score
        self.match, self._new_share = match, 1.0 - best.inliers - best.conflicts
        self.counts["in_conflict"] += best.conflicts > MAX_NOISE_CONFLICTS
        observed = self._observability(points, match)
        self.pose = self._filter.update(match.pose, match.information, observed)
        if self._is_typical(best):
            self._tentative_time = 0.0
        elif self._tentative_time <= 0.0 and (self._lost or self._prediction_rejected):
            self._tentative_time = CONFIRMATION_TIME
        else:
            self._tentative_time -= self._prior.dt * match_score / self._mean_score
        self.may_map = self._tentative_time <= 0.0
        if self.may_map:
            share = min(1.0, self._prior.dt / SCORE_AVERAGING_TIME) if self._has_matched else 1.0
            self._mean_score += share * (match_score - self._mean_score)
            self._has_matched = self._has_odometry = True
            self._unmatched_time = self._new_ground_time = 0.0
            self._relocalizer.reset()
        self._lost = False
        self.quality = max(match_score, 0.0)
        is_held = self._has_odometry and self._has_low_variance()
        self._set_state(self.may_map, lost=not is_held)
        if not self.may_map:  # a tentative match may be at a wrong place
            self._unmatched_time += self._prior.dt
            self._relocalize(grid)
        return self.pose

    def _dead_reckon(self, best: Candidate | None, points: EndPoints, grid: MatchedMap) -> Pose2:
        """Keep the predicted pose, without a match; continue mapping where that is safe."""
        self._unmatched_time += self._prior.dt
        self._has_odometry &= self._filter.wheels
        new_share = self._share_in_new_ground(points, grid)
        self._new_share = max(new_share, 0.0)
        self._new_ground_time += self._prior.dt * new_share
        is_doubtful = self._prediction_rejected or self._tentative_time > 0.0
        self._lost |= (is_doubtful and not self._has_odometry) or not self._has_low_variance()
        if self._tentative_time > 0.0:
            self._tentative_time = CONFIRMATION_TIME
        self.quality = max(best.match_score, 0.0) if best else 0.0
        # without mapping, a robot in new ground would never match again
        limit = MAX_UNMATCHED_TIME if self._has_odometry else MAX_UNMATCHED_TIME_LASER_ONLY
        is_in_new_ground = new_share > 0.0 and not self._prediction_rejected
        self.may_map = is_in_new_ground and self._unmatched_time > limit
        self._set_state(False, self._lost)
        if self._lost or self._prediction_rejected:
            self._relocalize(grid)
        return self.pose

    @property
    def _prediction_rejected(self) -> bool:
        """Whether the prediction conflicts with the map for long: people, or a carried robot."""
        return self._unmatched_time > MAX_UNMATCHED_TIME and self._new_ground_time < 0.0

    def _share_in_new_ground(self, points: EndPoints, grid: MatchedMap) -> float:
        """Share of beams in new ground, less `CONFLICT_WEIGHT` times those in conflict."""
        if points.n == 0:
            return 0.0
        inliers, conflicts = grid.evaluate(points, self.pose)
        return 1.0 - inliers - conflicts - CONFLICT_WEIGHT * conflicts

    def _relocalize(self, grid: MatchedMap) -> None:
        """Global localization in the map, within the gate of a dead-reckoned pose."""
        if not self._p.relocate or self._unmatched_time < MAX_UNMATCHED_TIME:
            return
        variance = max(self._filter.covariance.diagonal()[:2].tolist())
        is_held = self._has_odometry and not self._prediction_rejected
        reach = math.sqrt(MATCH_GATE * variance) if is_held else math.inf
        found = self._relocalizer.update(self._scan, self.pose, reach, grid.crop)
        if found is None or (is_held and self._prior.mahalanobis_squared(found) > MATCH_GATE):
            return
        self._filter.set_pose(found, RELOCALIZED_COVARIANCE)
        self.pose = found
        self.counts["relocalized"] += 1
        self._tentative_time, self._unmatched_time, self._lost = 0.0, 0.0, False

    def _has_low_variance(self) -> bool:
        xx, yy, heading = self._filter.covariance.diagonal().tolist()
        return bool(xx + yy < LOST_POSITION_STD**2 and heading < LOST_HEADING_STD**2)

    def _set_state(self, matched: bool, lost: bool) -> None:
        self.state = "lost" if lost else "matched" if matched else "predicted"
        self.counts[self.state] += 1
