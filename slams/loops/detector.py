"""LoopDetector: find keyframes at places that were visited long before.

A keyframe is matched with the local maps of all places within the covariance of the graph, and a
match is verified in both directions. If only one place is possible, it is accepted at once. Else
it becomes a hypothesis that the next keyframes confirm by a match where the hypothesis predicts it.
A hypothesis that does not predict a place to a meter is dropped. A keyframe in a corridor matches
anywhere; it neither confirms nor rejects.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.frontend.correlative import Window
from slams.loops import matching
from slams.loops.graph import LoopEdge, PoseGraph, position_distance
from slams.loops.matching import LOOP_EDGE_STD, Keyframe, LocalMap
from slams.metrics import Indices
from slams.types import Floats, Pose2, wrap_angle

QUERY_SPACING = 1.0  # m of path between two keyframes that are searched for
LOCAL_MAP_RADIUS = 4.0  # m of path that a local map covers; nearer positions are one place
LOCAL_MAP_SPACING = 0.9  # m of path between two keyframes of a local map
LOOP_GATE = 12.0  # largest squared Mahalanobis distance of a loop from its expected pose
LOOP_SEARCH_DEVIATIONS = 3.0  # standard deviations of the graph that a search covers
MIN_LOOP_LIKELIHOOD = 0.6  # of a match, below it is not verified
MIN_LOOP_SCORE = 0.3  # inlier ratio less conflict ratio, in each direction
MIN_UNPREDICTED_SCORE = 0.7  # mean of both directions: of a first match, and of a hypothesis
MIN_SCORE_LEAD = 0.1  # of the best match over the best one at another place
LOOP_TOLERANCE, LOOP_ROTATION_TOLERANCE = 0.1, 0.02  # m, rad between two matches of one loop
AMBIGUITY_DISTANCE = 1.0  # m, beyond the covariance and in a window, to show a corridor
MAX_CERTAIN_STD = 0.3  # m, deviation of the position at which only one place is possible
MIN_CONFIRMATIONS = 3  # loops, over as many spacings of path, that confirm a hypothesis
MAX_UNMATCHED_KEYFRAMES = 4  # not matching where predicted; so many reject a hypothesis


class VerifiedMatch(NamedTuple):
    """A loop edge that was verified, and its match score, the mean of both directions.

    `is_observed`: in both axes of the position. `is_expected`: its pose is within the gate.
    """

    edge: LoopEdge
    score: float
    is_observed: bool
    is_expected: bool = True


# an earlier keyframe, the expected pose of the later one in its frame, its covariance (3, 3)
Candidate = tuple[int, Pose2, Floats]


class Query(NamedTuple):
    """Keyframe `later`, its local map, the candidates yet to be matched, and the matches so far."""

    later: int
    local_map: LocalMap
    candidates: list[Candidate]
    matches: list[VerifiedMatch]
    is_predicted: bool


class LoopDetector:
    """Finds loops in a graph; each call of `work` matches a few candidates.

    Args:
        graph: poses of the keyframes.
        keyframes: their scans.
        min_path: least path length between two visits of a place [m].
    """

    def __init__(self, graph: PoseGraph, keyframes: list[Keyframe], min_path: float) -> None:
        self._graph, self._keyframes, self._min_path = graph, keyframes, min_path
        self._query: Query | None = None
        self._hypothesis: list[VerifiedMatch] = []
        self._checked: list[int] = []  # keyframes that were matched to check the hypothesis
        self._unmatched = 0  # keyframes of these that did not match where predicted
        self._last_query_path = 0.0  # [m]
        self._n_searched = 0  # keyframes of the graph when no query was due

    def work(self, n_candidates: int = 1) -> list[LoopEdge]:
        """Match with at most `n_candidates`; returns the loops that are accepted now."""
        for _ in range(n_candidates):
            if self._query is None and self._n_searched < self._graph.n:
                self._query = self._next_query()
            if (query := self._query) is None:
                self._n_searched = self._graph.n  # nothing is due until the next keyframe
                break
            self._match(query, query.candidates.pop(0))
            if not query.candidates:
                self._query = None
                loops = self._conclude(query)
                if loops:
                    return loops
        return []

    def skip(self) -> None:
        """Search next beyond the local map of the last loop, which has confirmed the graph."""
        self._last_query_path += LOCAL_MAP_RADIUS

    def verify_jump(self, map_poses: Sequence[Pose2], pose: Pose2) -> LoopEdge | None:
        """The loop by which the last keyframe is at `pose` in the algorithm's map, if verified.

        `map_poses`: poses of all keyframes in that map.
        """
        graph, later = self._graph, self._graph.n - 1
        old = np.flatnonzero(graph.path < graph.path[later] - self._min_path)
        if old.size == 0:
            return None
        earlier = min(old.tolist(), key=lambda k: position_distance(map_poses[k], pose))
        expected = map_poses[earlier].between(pose)
        query = Query(later, self._local_map(later), [], [], False)
        candidate = earlier, graph.step(earlier, later), graph.uncertainty(later)[earlier]
        window = Window(expected, AMBIGUITY_DISTANCE, 2.0 * LOOP_ROTATION_TOLERANCE)
        self._match(query, candidate, window)
        best = self._best(query)
        if best is None:
            return None
        error = expected.between(best.edge.pose)  # large if the pose was that of a delayed scan
        return best.edge if math.hypot(error.x, error.y) < LOOP_TOLERANCE else None

    def _next_query(self) -> Query | None:
        """Check the hypothesis, or search for the last keyframe with a complete local map."""
        graph = self._graph
        if self._hypothesis:
            return self._hypothesis_query()
        path = float(graph.path[-1]) - LOCAL_MAP_RADIUS
        if path - self._last_query_path < QUERY_SPACING:
            return None
        self._last_query_path = path
        later = int(np.searchsorted(graph.path, path))
        old = np.flatnonzero(graph.path < graph.path[later] - self._min_path)
        covariances = graph.uncertainty(later)[old]
        distances = np.hypot(*(graph.poses[old, :2] - graph.poses[later, :2]).T)
        deviation = np.sqrt(covariances[:, 0, 0] + covariances[:, 1, 1])
        reach = LOOP_SEARCH_DEVIATIONS * deviation
        is_near = distances < LOCAL_MAP_RADIUS + reach
        if not is_near.any():
            return None
        is_near &= distances <= np.maximum(AMBIGUITY_DISTANCE + reach, distances[is_near].min())
        chosen = self._nearest(old, distances, is_near)
        is_certain = bool(deviation[chosen[0]] < MAX_CERTAIN_STD)
        candidates = [
            (int(old[k]), graph.step(int(old[k]), later), covariances[k])
            for k in chosen[: 1 if is_certain else None]
        ]
        return Query(later, self._local_map(later), candidates, [], is_certain)

    def _hypothesis_query(self) -> Query | None:
        """Match the next keyframe before or after the hypothesis where it predicts it, if due."""
        graph, path = self._graph, self._graph.path
        after = np.flatnonzero(path >= path[max(self._checked)] + QUERY_SPACING)
        after = after[path[after] <= path[-1] - LOCAL_MAP_RADIUS]
        before = np.flatnonzero(path <= path[min(self._checked)] - QUERY_SPACING)
        before = before[path[before] > self._min_path]  # else no keyframe is old enough
        if after.size:
            later = int(after[0])
        elif before.size and path[self._checked[0]] - path[before[-1]] < LOCAL_MAP_RADIUS:
            later = int(before[-1])
        else:
            return None
        self._checked.append(later)
        edges = [match.edge for match in self._hypothesis]
        nearest = min(edges, key=lambda edge: abs(path[edge.later] - path[later]))
        pose = graph.pose(nearest.earlier) @ nearest.pose @ graph.step(nearest.later, later)
        old = np.flatnonzero(path < path[later] - self._min_path)
        distances = np.hypot(*(graph.poses[old, :2] - np.array(pose[:2])).T)
        to_later, to_earlier = graph.uncertainty(nearest.later), graph.uncertainty(nearest.earlier)
        is_near = distances <= max(LOCAL_MAP_RADIUS, distances.min())
        candidates = [
            (int(k), graph.pose(int(k)).between(pose), to_later[later] + to_earlier[k])
            for k in old[self._nearest(old, distances, is_near)[:2]]
        ]
        covariance = candidates[0][2]
        if covariance[0, 0] + covariance[1, 1] > AMBIGUITY_DISTANCE**2:
            self._hypothesis = []  # any place would confirm it
            return None
        return Query(later, self._local_map(later), candidates, [], True)

    def _nearest(self, old: Indices, distances: Floats, eligible: NDArray[np.bool_]) -> list[int]:
        """Indices into `old`: at each place the nearest eligible keyframe of each direction."""
        chosen: list[int] = []
        while eligible.any():
            k = int(np.argmin(np.where(eligible, distances, np.inf)))
            chosen.append(k)
            x, y, rotation = (self._graph.poses[old] - self._graph.poses[old[k]]).T
            eligible = eligible & ((np.hypot(x, y) > LOCAL_MAP_RADIUS) | (np.cos(rotation) < 0.0))
        return chosen

    def _match(self, query: Query, candidate: Candidate, window: Window | None = None) -> None:
        """Search the keyframe in the local map of a candidate, and verify the match."""
        earlier, expected, covariance = candidate
        earlier_map, window = self._local_map(earlier), window or _window(expected, covariance)
        found = earlier_map.search(self._keyframes[query.later].ends, window, MIN_LOOP_LIKELIHOOD)
        if found.likelihood >= MIN_LOOP_LIKELIHOOD:
            edge = LoopEdge(earlier, query.later, found.pose)
            match = self._verify(edge, earlier_map, query.local_map, found.spread)
            if match is not None:
                error = np.array(self._implied_pose(match.edge))
                error -= self._graph.pose(earlier) @ expected
                error[2] = wrap_angle(float(error[2]))
                noise = covariance + np.diag(np.square(LOOP_EDGE_STD))
                is_expected = float(error @ np.linalg.solve(noise, error)) < LOOP_GATE
                query.matches.append(match._replace(is_expected=is_expected))

    def _verify(
        self, edge: LoopEdge, earlier_map: LocalMap, later_map: LocalMap, spread: Floats
    ) -> VerifiedMatch | None:
        """The match in both directions, if both lead to one pose and the scores suffice."""
        key, old = self._keyframes[edge.later], self._keyframes[edge.earlier]
        points, frame = matching.read_end_points(key.scan, key.twist)
        match = earlier_map.fit(points, edge.pose @ frame)
        pose = match.pose @ frame.inverse()
        forward = earlier_map.match_score(key.ends, pose)
        if forward < MIN_LOOP_SCORE:
            return None
        projection = matching.observable_part(points, pose.theta, spread)
        points, frame = matching.read_end_points(old.scan, old.twist)
        back = later_map.fit(points, pose.inverse() @ frame).pose @ frame.inverse()
        error = pose @ back
        distance = math.hypot(*(projection @ np.array(error[:2])))
        if distance > LOOP_TOLERANCE or abs(error.theta) > LOOP_ROTATION_TOLERANCE:
            return None
        backward = later_map.match_score(old.ends, pose.inverse())
        if backward < MIN_LOOP_SCORE:
            return None
        information = matching.loop_information(match, projection)
        edge = edge._replace(pose=pose, information=information)
        least = float(np.linalg.eigvalsh(information[:2, :2])[0])
        return VerifiedMatch(edge, 0.5 * (forward + backward), least > LOOP_TOLERANCE**-2)

    def _local_map(self, middle: int) -> LocalMap:
        """The local map around one keyframe, in its frame."""
        path, chosen = self._graph.path, [middle]
        for side in (range(middle - 1, -1, -1), range(middle + 1, len(path))):
            last = middle
            for k in side:
                if abs(path[k] - path[middle]) > LOCAL_MAP_RADIUS:
                    break
                if abs(path[k] - path[last]) >= LOCAL_MAP_SPACING:
                    chosen.append(k)
                    last = k
        poses = [self._graph.step(middle, k) for k in chosen]
        return LocalMap([self._keyframes[k] for k in chosen], poses)

    def _conclude(self, query: Query) -> list[LoopEdge]:
        """The loops that are accepted once all candidates of a keyframe were matched."""
        best = self._best(query)
        if best is not None and not self._hypothesis:
            if query.is_predicted:
                return [best.edge]
            self._checked, self._unmatched = [query.later], 0
        elif all(match.is_observed and not match.is_expected for match in query.matches):
            self._unmatched += 1  # a match along a corridor does not reject the hypothesis
        if best is not None and best.is_observed:
            self._hypothesis.append(best)
        path = self._graph.path[[match.edge.later for match in self._hypothesis]]
        ready = len(path) >= MIN_CONFIRMATIONS and np.ptp(path) >= MIN_CONFIRMATIONS * QUERY_SPACING
        scores = [match.score for match in self._hypothesis]
        is_confirmed = ready and np.mean(scores) >= MIN_UNPREDICTED_SCORE
        loops = [match.edge for match in self._hypothesis] if is_confirmed else []
        if is_confirmed or self._unmatched >= MAX_UNMATCHED_KEYFRAMES:
            self._hypothesis = []
        return loops

    def _best(self, query: Query) -> VerifiedMatch | None:
        """The best match, unless a match at another place is nearly as good."""
        good = [match for match in query.matches if match.is_expected]
        if not query.is_predicted:
            good = [m for m in good if m.is_observed and m.score >= MIN_UNPREDICTED_SCORE]
        if not good:
            return None
        best = max(good, key=lambda match: match.score)
        for match in good:
            offset = self._implied_pose(best.edge).between(self._implied_pose(match.edge))
            is_elsewhere = math.hypot(offset.x, offset.y) > LOCAL_MAP_RADIUS
            if is_elsewhere and best.score - match.score < MIN_SCORE_LEAD:
                return None
        return best

    def _implied_pose(self, edge: LoopEdge) -> Pose2:
        """The pose of the later keyframe in the map frame, by a loop edge."""
        return self._graph.pose(edge.earlier) @ edge.pose


def _window(expected: Pose2, covariance: Floats) -> Window:
    """Window around the expected pose: its covariance, limited to the local map's extent."""
    variance = max(covariance[0, 0], covariance[1, 1])
    half = LOOP_SEARCH_DEVIATIONS * math.sqrt(variance) + 2.0 * LOOP_EDGE_STD[0]
    rotation = LOOP_SEARCH_DEVIATIONS * math.sqrt(covariance[2, 2]) + 2.0 * LOOP_EDGE_STD[2]
    low = [max(v - half, -LOCAL_MAP_RADIUS) for v in expected[:2]]
    high = [min(v + half, LOCAL_MAP_RADIUS) for v in expected[:2]]
    x, y = (0.5 * (a + b) for a, b in zip(low, high, strict=True))
    widest = max(AMBIGUITY_DISTANCE, *(0.5 * (b - a) for a, b in zip(low, high, strict=True)))
    return Window(Pose2(x, y, expected.theta), widest, rotation)
