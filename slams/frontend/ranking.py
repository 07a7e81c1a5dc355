"""Which of several matches explains a scan best, and where else to look if none does.

One number ranks them all: score = (inliers - conflicts) / n - prior cost / pieces.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from slams.frontend.correlative import ALIKE, LikelihoodField, search, window_of
from slams.frontend.motion_filter import Prediction
from slams.frontend.update_kernels import LATENCY
from slams.geometry import student_cost
from slams.grid_bounds import Box
from slams.refine.lines import Match
from slams.scan.end_points import EndPoints
from slams.types import OccupancyGrid, Pose2, wrap_angle

PIECES = 50.0  # of wall in a scan whose errors are independent of each other
TRIES = 6  # poses of a correlative search that are matched
SPEED, TURN_RATE = 2.0, 2.0  # m/s, rad/s: how fast a robot drives and turns

Rematch = Callable[[EndPoints, Pose2, Prediction], list[Match]]


class MatchedMap(Protocol):
    """What the estimator asks of an algorithm's map."""

    @property
    def empty(self) -> bool:
        """Whether no scan has entered the map."""
        ...

    def evaluate(self, points: EndPoints, pose: Pose2) -> tuple[float, float]:
        """Shares of the beams that are inliers at a pose, and that are in conflict with the map."""
        ...

    def likelihood_field(self) -> LikelihoodField:
        """A coarse likelihood of walls, for correlative search."""
        ...

    def crop(self, box: Box) -> OccupancyGrid | None:
        """The part of the map in a box, None if nothing was observed there."""
        ...


class Candidate(NamedTuple):
    """A match, its squared distance from the prior, and shares of beams for and against it.

    `seconds`: how long a robot drives from the prediction to the match.
    """

    match: Match
    distance: float
    seconds: float
    inliers: float
    conflicts: float

    @property
    def match_score(self) -> float:
        """What the scan says."""
        return self.inliers - self.conflicts

    @property
    def score(self) -> float:
        """What scan and prior say."""
        return self.match_score - student_cost(self.distance) / PIECES


def rank(match: Match, points: EndPoints, grid: MatchedMap, prior: Prediction) -> Candidate:
    """A match with what map and prior say of it."""
    x, y, theta = match.pose
    off, turn = math.hypot(x - prior.pose.x, y - prior.pose.y), wrap_angle(theta - prior.pose.theta)
    seconds = max(off / SPEED, abs(turn) / TURN_RATE)
    return Candidate(match, prior.distance(match.pose), seconds, *grid.evaluate(points, match.pose))


def best_of(
    matches: Sequence[Match], points: EndPoints, grid: MatchedMap, prior: Prediction
) -> Candidate:
    """The match with the highest score, if it leads the first by a piece of wall at least."""
    ranked = [rank(match, points, grid, prior) for match in matches]
    best = max(ranked, key=lambda candidate: candidate.score)
    return best if best.score - ranked[0].score >= 1.0 / PIECES else ranked[0]


def best_around(
    first: Match, points: EndPoints, grid: MatchedMap, prior: Prediction, rematch: Rematch
) -> Candidate:
    """The best of a match and those from where a correlative search of the prior's window leads.

    The window reaches as far as a robot drives and turns while a recorder keeps a scan back.
    """
    window, found = window_of(prior.pose, prior.covariance), [first]
    half = max(window.half, SPEED * LATENCY)
    window = window._replace(half=half, rotation=max(window.rotation, TURN_RATE * LATENCY))
    poses, _ = search(grid.likelihood_field(), points.points[:, : points.n], window, alike=ALIKE)
    starts = [(Pose2(*pose), likelihood) for *pose, likelihood in poses.tolist()]
    starts.sort(key=lambda start: student_cost(prior.distance(start[0])) / PIECES - start[1])
    for start, _ in starts[:TRIES]:
        found += rematch(points, start, prior)
    return best_of(found, points, grid, prior)
