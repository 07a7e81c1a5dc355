"""Hector SLAM: scan matching by gradient on a pyramid of occupancy grids.

[Kohlbrecher11] S. Kohlbrecher, O. von Stryk, J. Meyer, U. Klingauf: A Flexible and Scalable SLAM
System with Full 3D Motion Estimation. IEEE SSRR 2011. Per scan:

1. A start for the pose; ours: with a covariance.
2. End points of the beams in the base frame (sec. IV-A); ours: as it is in the middle of the sweep.
3. Scan matching (sec. IV-B): Gauss-Newton on the occupancy, coarse to fine (sec. IV-C).
4. ours: straight on the lines inside the finest cells, from there or, where that is within half a
   cell, from the start; where other starts end elsewhere the beams decide.
5. ours: a slow sweep is freed from the motion that was found, and matched again.
6. ours: if the map contradicts the scan, a search.
7. The pose is the match's; ours: what stays bad is refused, and the prediction stands; on ground
   of old the drift of the loop is taken back.
8. If the robot has moved, insert the scan into every level (sec. IV-A).
9. ours: a robot that is lost is looked for in all of its map.
10. ours: from the middle of the sweep back to its stamp, the first beam's.

The published program, `hector@original`, stands in `original`; `hector@paper` ends with step 3.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

from hector.map import LogOddsPyramid
from hector.matcher import FIRST, Matcher, gap
from hector.params import HectorParams
from slams.geometry import Prior
from slams.localize.relocator import Relocator
from slams.motion.model import Prediction
from slams.motion.track import Track
from slams.params import Params
from slams.patience import Patience
from slams.refine.lines import Match
from slams.scan.end_points import EndPoints
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan, State
from slams.usual import Usual

OFTEN = 0.08  # s between scans with other starts: every scan at 10 Hz, one in four at 40
MEMORY = 0.1  # s over which the share explained is usual: what is doubtful comes suddenly
SAME = 0.25  # of a cell, within which two fits are one
FEWEST = 10  # end points that a map begins with: of fewer there is nothing to be found again
ONE_PLACE = 0.5  # of a cell, within which two climbs are


class Hector:
    """Gradient map matching on a grid pyramid; see the module for the steps.

    `frozen`: nothing enters the map.
    """

    Params: ClassVar[type[Params]] = HectorParams

    def __init__(self, params: HectorParams) -> None:
        self.params = params
        self.frozen = False
        self._map = LogOddsPyramid(params)
        self._matcher = Matcher(params, self._map)
        self._scan = EndPoints(params)
        self._track = Track(params)
        self._relocator = Relocator(self._track, params.relocate)
        self._patience = Patience(params.rest, params.longest_rest)
        self._often = Patience(OFTEN, OFTEN)
        self._match = self._key = FIRST
        self._posed = IDENTITY
        self._usual = Usual(MEMORY, 1.0)
        names = "empty posed kept refined doubted searched refused inserted"
        self._counts = dict.fromkeys(names.split(), 0)

    def update(self, scan: Scan) -> Pose2:
        """Match the scan to the map, let it enter the map if due; return T_map_base."""
        start = self._track.predict(scan)  # 1.
        self._often.wait(start.dt)
        points = self._scan.take(scan, start.velocity)  # 2.
        match = self._matched(points, start)  # 3., 4.
        if points.sweeps:  # 5.
            points = self._scan.take(scan, self._track.motion.velocity_to(match.pose))
            match = self._matched(points, start)
        if self._doubtful(points, match, start.dt):  # 6.
            match, accepted = self._recovered(points, start, match)
        else:
            accepted = points.n >= (FEWEST if self._map.insertions == 0 else 1)
        self._settle(scan, points, match, accepted)  # 7.
        self._relocator.old_ground.update(scan)
        if self._due(points):  # 8.
            self._insert(points)
        self._relocator.update(scan, self.map)  # 9.
        return points.at_stamp(self._track.pose)  # 10.

    def insert_at(self, scan: Scan, pose: Pose2) -> None:
        """Let a scan enter the map at a known pose, without matching."""
        self._track.placed(pose, scan)
        points = self._scan.take(scan, IDENTITY)
        if points.n > 0 and not self.frozen:
            self._insert(points)

    def map(self) -> OccupancyGrid:
        """The finest level as probabilities."""
        return self._map.grid()

    def report(self) -> dict[str, Any]:
        """Counts of scans.

        `posed` by the pyramid, `kept` where the pose within a cell of that won, `refined` by the
        lines; `doubted`, `searched`, `refused`, `lost`; `empty`, `inserted`; with odometry ...
        """
        lost = {"lost": self._track.lost} | self._relocator.counts
        counts = self._counts | lost | self._track.motion.counts
        return counts | self._map.extent.counts

    @property
    def state(self) -> State:
        """How the last pose came about."""
        return self._track.state

    @property
    def quality(self) -> float:
        """Share of the last scan's beams that the map explains, 0..1 (1 of the first scan)."""
        return self._match.share

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the last pose against the map [m^2, m rad, rad^2]."""
        return self._track.covariance

    def _matched(self, points: EndPoints, start: Prediction) -> Match:
        """Steps 3 and 4, from the prediction and from other starts that are not the same."""
        expected = start.pose
        if self._map.insertions == 0 or points.n == 0:
            return self._match._replace(pose=expected)
        prior = self._prior(expected)
        posed = self._matcher.climb(points, expected, prior)
        tried = self._tried(points, expected, posed, prior)
        self._posed = posed.pose
        for other in self._others(points, start):
            climbed = self._matcher.climb(points, other, prior)
            if gap(points, climbed.pose, posed.pose) > ONE_PLACE * self.params.resolution:
                tried += self._tried(points, other, climbed, prior)
        return self._matcher.best(points, tried, self._track)[0] if len(tried) > 1 else tried[0]

    def _prior(self, expected: Pose2) -> Prior:
        return Prior(expected, self._track.prior(expected))

    def _tried(self, points: EndPoints, start: Pose2, posed: Match, prior: Prior) -> list[Match]:
        """The lines' pose; the pyramid's and another of the lines where those are elsewhere.

        Within half a cell the same lines are met from the start and from where the pyramid ended,
        and the start is the nearer: cells end millimeters off.
        """
        if not self.params.refine:
            return [posed]
        cell = self.params.resolution
        near = gap(points, posed.pose, start) <= 0.5 * cell
        tried = [self._map.lines.fit(points, start if near else posed.pose, prior, near)]
        if not near:
            from_start = self._map.lines.fit(points, start, prior)
            if gap(points, from_start.pose, tried[0].pose) > SAME * cell:
                tried.insert(0, from_start)
        if gap(points, posed.pose, tried[-1].pose) > cell:
            tried.append(posed)
        return tried

    def _others(self, points: EndPoints, start: Prediction) -> list[Pose2]:
        """Starts elsewhere, now and then: no motion, and the motion so far."""
        if not self._often.over:
            return []
        before, half = self._track.pose, 0.5 * self.params.resolution
        others = [before, before @ start.continued]
        others = [other for other in others if gap(points, other, start.pose) > half]
        if others:
            self._often.tried()
        return others

    def _doubtful(self, points: EndPoints, match: Match, dt: float) -> bool:
        """Whether the map explains less than usual, or no robot can be there."""
        known = self._map.insertions > 0 and points.n > 0
        less = match.share < self.params.convincing * self._usual.value
        doubtful = known and (less or not self._track.reachable(match.pose))
        self._counts["doubted"] += doubtful
        self._patience.wait(dt, quiet=not doubtful)
        return doubtful

    def _recovered(self, points: EndPoints, start: Prediction, match: Match) -> tuple[Match, bool]:
        """Step 6: what a search finds if the map contradicts the match; whether that is good."""
        best, clear = self._matcher.best(points, [match], self._track)
        if clear < self.params.lost and self._patience.over:
            self._patience.tried()
            self._counts["searched"] += 1
            found = self._map.search(points, start.pose)
            tried = [best, *self._from(found, points, start.pose)]
            best, clear = self._matcher.best(points, tried, self._track)
        return best, clear >= self.params.lost and self._track.reachable(best.pose)

    def _from(self, starts: list[Pose2], points: EndPoints, expected: Pose2) -> list[Match]:
        prior, tried = self._prior(expected), list[Match]()
        for start in starts:
            posed = self._matcher.climb(points, start, prior)
            tried += self._tried(points, start, posed, prior)
            self._posed = posed.pose
        return tried

    def _settle(self, scan: Scan, points: EndPoints, match: Match, accepted: bool) -> None:
        """Step 7: tell the track what was found."""
        self._match = match
        self._count(points, match, accepted)
        if accepted:
            if self.params.refine:
                self._map.lines.learn(match, points)
            self._track.matched(match.pose, match.seen, scan, match.rough)
            self._usual.learn(match.share, scan.t)
        else:
            self._track.missed(scan)

    def _count(self, points: EndPoints, match: Match, accepted: bool) -> None:
        counts, known = self._counts, self._map.insertions > 0 and points.n > 0
        counts["empty"] += points.n == 0
        counts["posed"] += known
        if known and accepted:
            counts["kept"] += gap(points, self._posed, match.pose) < self.params.resolution
            counts["refined"] += self.params.refine and match.pose != self._posed
        counts["refused"] += known and not accepted

    def _due(self, points: EndPoints) -> bool:
        """Step 8: far enough from the last insertion, or much that the map did not explain."""
        track, key = self._track, self._key
        if self.frozen or points.n == 0:
            return False
        if track.state != "matched" and not track.adrift:
            return self._new_surroundings(points)
        if self._map.insertions < self.params.settle:
            return True
        step = key.pose.between(track.pose)
        moved = math.hypot(step.x, step.y) > self.params.insert_distance
        turned = abs(step.theta) > self.params.insert_angle
        return moved or turned or self._match.share < self.params.convincing * key.share

    def _new_surroundings(self, points: EndPoints) -> bool:
        """Whether wheels alone have held the pose for long, and the map does not contradict it."""
        held = self._track.held and points.n > 0
        return held and float(self._map.evidence(points, self._track.pose).mean()) > 0.0

    def _insert(self, points: EndPoints) -> None:
        entered = self._map.insert(points, self._track.pose)
        self._key = self._match._replace(pose=self._track.pose)
        self._counts["inserted"] += entered
