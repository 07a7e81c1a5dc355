"""Ranking of matches by one score, and correlative search for more of them.

score = (inliers - conflicts) / n - prior cost / number of independent surfaces.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from slams.frontend.correlative import SEARCH_SCORE_TOLERANCE, LikelihoodField, search, window_of
from slams.frontend.motion_filter import Prediction
from slams.frontend.update_kernels import MAX_SCAN_DELAY
from slams.geometry import student_cost
from slams.grid_bounds import Box
from slams.refine.lines import Match
from slams.scan.end_points import EndPoints
from slams.types import OccupancyGrid, Pose2, wrap_angle

N_INDEPENDENT_SURFACES = 50.0  # in a scan; errors of beams on one surface are correlated
MAX_SEARCH_STARTS = 6  # poses of a correlative search that are matched
MAX_ROBOT_SPEED, MAX_ROBOT_TURN_RATE = 2.0, 2.0  # m/s, rad/s, for the motion bound

Rematch = Callable[[EndPoints, Pose2, Prediction], list[Match]]


class MatchedMap(Protocol):
    """Interface of an algorithm's map to the estimator."""

    @property
    def empty(self) -> bool:
        """Whether no scan has entered the map."""

    def evaluate(self, points: EndPoints, pose: Pose2) -> tuple[float, float]:
        """Shares of the beams that are inliers, and that are in conflict with the map."""

    def likelihood_field(self) -> LikelihoodField:
        """A coarse likelihood of walls, for correlative search."""

    def crop(self, box: Box) -> OccupancyGrid | None:
        """The part of the map in a box, None if nothing was observed there."""


class Candidate(NamedTuple):
    """A match with its squared Mahalanobis distance from the prior and its shares of beams.

    `seconds`: least time in which a robot moves from the prediction to the match.
    """

    match: Match
    mahalanobis_squared: float
    seconds: float
    inliers: float
    conflicts: float

    @property
    def match_score(self) -> float:
        """Score by the scan alone."""
        return self.inliers - self.conflicts

    @property
    def score(self) -> float:
        """Score by scan and prior."""
        return self.match_score - _prior_cost(self.mahalanobis_squared)


def _prior_cost(squared: float) -> float:
    """Cost of a squared Mahalanobis distance from the prior, as a share of the beams."""
    return student_cost(squared) / N_INDEPENDENT_SURFACES


def rank(match: Match, points: EndPoints, grid: MatchedMap, prior: Prediction) -> Candidate:
    """A match with its distances from the prior and its evaluation in the map."""
    pose, (x, y, theta) = match.pose, prior.pose
    distance, rotation = math.hypot(pose.x - x, pose.y - y), wrap_angle(pose.theta - theta)
    seconds = max(distance / MAX_ROBOT_SPEED, abs(rotation) / MAX_ROBOT_TURN_RATE)
    return Candidate(match, prior.mahalanobis_squared(pose), seconds, *grid.evaluate(points, pose))


def best_of(
    matches: Sequence[Match], points: EndPoints, grid: MatchedMap, prior: Prediction
) -> Candidate:
    """The match with the highest score; the first one unless the lead is a surface or more."""
    ranked = [rank(match, points, grid, prior) for match in matches]
    best, first = max(ranked, key=lambda candidate: candidate.score), ranked[0]
    has_lead = best is not first and best.score - first.score >= 1.0 / N_INDEPENDENT_SURFACES
    return best if has_lead else first


def best_around(
    first: Match, points: EndPoints, grid: MatchedMap, prior: Prediction, rematch: Rematch
) -> Candidate:
    """The best of a match and of those that start from a correlative search around the prior.

    The window covers the motion bound: as far as a robot moves in the longest delay of a scan.
    """
    window, found = window_of(prior.pose, prior.covariance), [first]
    half_width = max(window.half_width, MAX_ROBOT_SPEED * MAX_SCAN_DELAY)
    half_rotation = max(window.half_rotation, MAX_ROBOT_TURN_RATE * MAX_SCAN_DELAY)
    window = window._replace(half_width=half_width, half_rotation=half_rotation)
    ends, field = points.points[:, : points.n], grid.likelihood_field()
    poses, _ = search(field, ends, window, tolerance=SEARCH_SCORE_TOLERANCE)
    starts = [(Pose2(*pose), likelihood) for *pose, likelihood in poses.tolist()]
    starts.sort(key=lambda start: _prior_cost(prior.mahalanobis_squared(start[0])) - start[1])
    for start, _ in starts[:MAX_SEARCH_STARTS]:
        found += rematch(points, start, prior)
    return best_of(found, points, grid, prior)
