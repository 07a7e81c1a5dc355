"""GlobalLocalizer: the pose of a robot in a map, from nothing, over as many scans as it takes.

    >>> localizer = GlobalLocalizer(read_map("map.yaml"))
    >>> for scan in log:
    ...     found = localizer.add(scan)
    ...     if found:
    ...         break

A scan is searched for in all of the map, and the best poses are fitted to the walls. The likely
ones are candidates: they are tracked from scan to scan, and whenever the robot has moved on the map
is searched again and their probabilities are multiplied by what the scan says. Alike rooms stay
candidates until the robot has left them. With bounded `work` a search is spread over scans; those
that come meanwhile wait, and the candidates are tracked through them afterwards.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.localize.map_index import (
    FIT,
    POSES,
    Candidate,
    MapIndex,
    Search,
    Work,
    has_enough,
    merged,
)
from slams.types import IDENTITY, OccupancyGrid, Pose2, Scan

CERTAIN = 0.95  # probability from which the pose is known
MIN_SCORE = 0.5  # inliers less conflicts from which a map explains a scan
MAX_CONFLICTS = 0.1  # share of beams through walls, up to which it does
SEARCH_DISTANCE, SEARCH_ROTATION = 0.3, 0.3  # m, rad: after so much a scan tells something new
SEARCH_TIME = 2.0  # s after which a search is made without any motion: a candidate is confirmed


class Observation(NamedTuple):
    """A scan, a dead-reckoned pose of the base, and how far the base is from it at most [m]."""

    scan: Scan
    predicted: Pose2 | None
    reach: float

    def reaches(self, pose: Pose2) -> bool:
        """Whether the base can be at `pose`."""
        p = self.predicted or IDENTITY
        return math.hypot(pose.x - p.x, pose.y - p.y) <= self.reach


class GlobalLocalizer:
    """Takes scans until one candidate is certain.

    `candidates` are the poses that the robot may have had at the last scan worked on, the most
    likely first; `failed`: the last search found none that explains its scan.

    Args:
        index: the map, or a `MapIndex` already made of it.
        work: for each scan at most [us]; without a bound every scan is done with at once.
        searches: how many of them a candidate has to stand.
        min_score: of a candidate that explains a scan.

    Raises:
        ValueError: the map is no floor with walls.
    """

    def __init__(
        self,
        index: OccupancyGrid | MapIndex,
        work: float = math.inf,
        searches: int = 1,
        min_score: float = MIN_SCORE,
    ) -> None:
        self.index = index if isinstance(index, MapIndex) else MapIndex(index)
        self.candidates: list[Candidate] = []
        self.failed = False
        self._work, self._searches, self._min_score = work, searches, min_score
        self._max_candidates = int(min(POSES, 0.5 * work / FIT))  # tracked through two scans a scan
        self._queue: list[Observation] = []  # to be worked on, the oldest first
        self._last: Pose2 | None = None  # predicted pose that the candidates belong to
        self._search: Search | None = None  # of the oldest in the queue
        self._searched_at, self._searched_from = 0.0, IDENTITY  # stamp and first pose then

    def add(
        self, scan: Scan, predicted: Pose2 | None = None, reach: float = math.inf
    ) -> Candidate | None:
        """Take the next scan; the base's pose at it, once that is certain, else None.

        Args:
            scan: ignored if less than 20 beams are valid.
            predicted: dead-reckoned pose of the base; without `reach` only its steps count. None:
                the scan's odometry; without that, each candidate's last step is made once more.
            reach: how far from it the base can be [m].
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

    def explains(self, candidate: Candidate) -> bool:
        """Whether the map explains a scan at a candidate."""
        return candidate.score >= self._min_score and candidate.conflicts < MAX_CONFLICTS

    @property
    def _is_certain(self) -> bool:
        """Whether the first candidate explains its scan, and no other is as likely."""
        if not self.candidates or not self.explains(first := self.candidates[0]):
            return False
        return first.probability >= CERTAIN and first.searches >= self._searches

    def _advance(self, at: Observation, work: Work) -> bool:
        """Track the candidates to a scan, and search for it if due; False if work is used up."""
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
        if self.candidates and not work.take(len(self.candidates) * FIT):
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
        """Whether a scan tells something new, or some time later can confirm the first candidate.

        Alike candidates are not compared again while the robot stands: its scans share their
        errors, which would add up to a wrong certainty.
        """
        if not self.candidates:
            return True
        if self._is_certain:
            return False
        first = self.candidates[0]
        way = self._searched_from.between(first.pose)
        if math.hypot(way.x, way.y) >= SEARCH_DISTANCE or abs(way.theta) >= SEARCH_ROTATION:
            return True
        waited = scan.t >= self._searched_at + SEARCH_TIME
        return waited and (first.probability >= CERTAIN or not self.explains(first))

    def _conclude(self, at: Observation, found: list[Candidate]) -> None:
        """Weigh the candidates anew, with those that the search has found."""
        known = [candidate for candidate in self.candidates if at.reaches(candidate.pose)]
        fresh = [candidate for candidate in found if at.reaches(candidate.pose)]
        self.candidates = merged(known, fresh)[: self._max_candidates]
        self.failed = not any(map(self.explains, self.candidates))
        self._searched_at = at.scan.t
        if self.candidates:
            self._searched_from = self.candidates[0].pose
