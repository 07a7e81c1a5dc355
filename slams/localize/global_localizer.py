"""GlobalLocalizer: global localization in a map, over as many scans as necessary.

    >>> localizer = GlobalLocalizer(read_map("map.yaml"))
    >>> for scan in log:
    ...     found = localizer.add(scan)
    ...     if found:
    ...         break

A search compares a scan with all of the map and fits the best poses to the walls. The likely poses
are candidates, which are tracked from scan to scan. After each 0.3 m of motion the map is searched
again, and the probabilities are multiplied by the likelihood of the new scan. Similar rooms remain
candidates until the robot has left them. With bounded `work` a search takes several scans; the
candidates are tracked through these scans afterwards.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.localize.map_index import (
    FIT_COST,
    MAX_FITTED_POSES,
    Candidate,
    MapIndex,
    Search,
    Work,
    has_enough,
    merged,
)
from slams.types import IDENTITY, OccupancyGrid, Pose2, Scan

CERTAIN_PROBABILITY = 0.95  # of the pose that is returned
MIN_CANDIDATE_SCORE = 0.5  # inlier ratio minus conflict of an accepted candidate
MAX_CONFLICT_RATIO = 0.1  # of an accepted candidate
SEARCH_DISTANCE, SEARCH_ROTATION = 0.3, 0.3  # m, rad: after it a scan has independent information
SEARCH_TIME = 2.0  # s after which a search is made without motion, to confirm a candidate


class Observation(NamedTuple):
    """A scan, the dead-reckoned pose of the base, and the motion bound around this pose [m]."""

    scan: Scan
    predicted: Pose2 | None
    reach: float

    def within_reach(self, pose: Pose2) -> bool:
        """Whether `pose` is within the motion bound."""
        p = self.predicted or IDENTITY
        return math.hypot(pose.x - p.x, pose.y - p.y) <= self.reach


class GlobalLocalizer:
    """Global localization of a robot from successive scans, until one candidate is certain.

    `candidates`: poses at the last scan that was processed, the most likely first. `failed`: no
    candidate of the last search was accepted.

    Args:
        index: the map, or its `MapIndex`.
        work: greatest work per scan [us]; without a bound each scan is processed at once.
        searches: number of searches that a candidate has to survive before it is certain.
        min_score: of an accepted candidate.

    Raises:
        ValueError: the map has no wall or no free space.
    """

    def __init__(
        self,
        index: OccupancyGrid | MapIndex,
        work: float = math.inf,
        searches: int = 1,
        min_score: float = MIN_CANDIDATE_SCORE,
    ) -> None:
        self.index = index if isinstance(index, MapIndex) else MapIndex(index)
        self.candidates: list[Candidate] = []
        self.failed = False
        self._work, self._searches, self._min_score = work, searches, min_score
        self._max_candidates = int(min(MAX_FITTED_POSES, 0.5 * work / FIT_COST))  # two scans in one
        self._queue: list[Observation] = []  # to process, the oldest first
        self._last: Pose2 | None = None  # predicted pose at the candidates' scan
        self._search: Search | None = None  # for the oldest in the queue
        self._searched_at = 0.0  # stamp of the last search
        self._searched_from = IDENTITY  # first pose after it

    def add(
        self, scan: Scan, predicted: Pose2 | None = None, reach: float = math.inf
    ) -> Candidate | None:
        """The base's pose at the next scan if it is certain, else None.

        Args:
            scan: ignored if less than 20 beams are valid.
            predicted: dead-reckoned pose of the base; without `reach` only its steps are used.
                None: the scan's odometry; without that, the last step of each candidate again.
            reach: motion bound: greatest distance of the base from `predicted` [m].
        """
        work = Work(self._work)
        if not has_enough(scan) or not self.index.prepare(work):
            return None
        self._queue.append(Observation(scan, predicted or scan.odometry, reach))
        while self._queue and self._advance(self._queue[0], work):
            pass
        return self.candidates[0] if not self._queue and self._is_certain else None

    @property
    def likely(self) -> str:
        """The three most likely candidates, for a message."""
        some = (f"{c} with probability {c.probability:.2f}" for c in self.candidates[:3])
        return "; ".join(some) or "none"

    def accepts(self, candidate: Candidate) -> bool:
        """Whether score and free-space conflict of a candidate are good enough."""
        return candidate.score >= self._min_score and candidate.conflicts < MAX_CONFLICT_RATIO

    @property
    def _is_certain(self) -> bool:
        """Whether the first candidate is accepted and more likely than all others."""
        if not self.candidates or not self.accepts(first := self.candidates[0]):
            return False
        return first.probability >= CERTAIN_PROBABILITY and first.searches >= self._searches

    def _advance(self, at: Observation, work: Work) -> bool:
        """Track the candidates to a scan, and search for it if due; False if no work is left."""
        if self._search is None:
            if not self._track(at, work):
                return False
            if self._is_due(at.scan):
                self._search = Search(self.index, at.scan)
        if self._search is not None:
            if not self._search.advance(work):
                return False
            self._conclude(at, self._search.found)
        self._search = None
        self._queue.pop(0)
        return True

    def _track(self, at: Observation, work: Work) -> bool:
        """Move the candidates by the predicted step, then to where the scan fits."""
        if self.candidates and not work.take(len(self.candidates) * FIT_COST):
            return False
        before, self._last = self._last, at.predicted
        step = before.between(at.predicted) if before and at.predicted else None
        starts = [c.pose @ (step or c.step) for c in self.candidates]
        pairs = zip(self.candidates, self.index.match(at.scan, starts), strict=True)
        self.candidates = [
            m._replace(probability=c.probability, step=c.pose.between(m.pose), searches=c.searches)
            for c, m in pairs
        ]
        return True

    def _is_due(self, scan: Scan) -> bool:
        """Whether the robot has moved since the last search, or the first candidate needs another.

        Similar candidates are not compared again while the robot stands: its scans have the same
        errors, whose repeated use would favor a wrong candidate.
        """
        if not self.candidates:
            return True
        if self._is_certain:
            return False
        first = self.candidates[0]
        step = self._searched_from.between(first.pose)
        if math.hypot(step.x, step.y) >= SEARCH_DISTANCE or abs(step.theta) >= SEARCH_ROTATION:
            return True
        waited = scan.t >= self._searched_at + SEARCH_TIME
        return waited and (first.probability >= CERTAIN_PROBABILITY or not self.accepts(first))

    def _conclude(self, at: Observation, found: list[Candidate]) -> None:
        """Combine the candidates with those of the search, and update the probabilities."""
        known = [candidate for candidate in self.candidates if at.within_reach(candidate.pose)]
        new = [candidate for candidate in found if at.within_reach(candidate.pose)]
        self.candidates = merged(known, new)[: self._max_candidates]
        self.failed = not any(map(self.accepts, self.candidates))
        self._searched_at = at.scan.t
        if self.candidates:
            self._searched_from = self.candidates[0].pose
