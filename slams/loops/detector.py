"""LoopDetector: which keyframes show a place that was seen long before.

A keyframe is searched for where the graph's own covariance leaves room for it. A match is verified
in both directions: the second leads back, and neither scan sees through walls of the other. Where
the covariance leaves no other place, such a loop is believed at once. Otherwise it is a hypothesis
that the next keyframes have to confirm, each by a match where the hypothesis predicts it, while it
predicts a place to a meter. Along a corridor everything matches: it neither confirms nor refutes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.frontend.correlative import Window
from slams.loops.graph import LoopEdge, PoseGraph
from slams.loops.matching import EDGE, Keyframe, LocalMap, information_of, observed, read
from slams.types import Floats, Pose2, wrap_angle

SPACING = 1.0  # m between two keyframes that are searched for
VIEW = 4.0  # m between two poses that see the same walls: a local map is drawn of those
LOCAL_SPACING = 0.9  # m of path between two of them
GATE = 12.0  # squared Mahalanobis distance of a loop from where it is expected, at most
DEVIATIONS = 3.0  # of the graph's covariance that are searched
MIN_SCORE = 0.6  # likelihood of a match that is verified
MIN_AGREEMENT = 0.3  # inliers less conflicts, in each direction
ALONE = 0.7  # the mean of both, of a match that nothing predicted, and of a hypothesis
MIN_LEAD = 0.1  # of inliers less conflicts, of the best match before the best elsewhere
AGREE, AGREE_ROTATION = 0.1, 0.02  # m, rad between the matches in both directions
AMBIGUITY = 1.0  # m, half of a window at least: shows whether a corridor is matched
CERTAIN = 0.3  # m: a deviation that leaves no other place
CONFIRMED = 3  # loops, over as many spacings of path, that make a hypothesis true
REFUTED = 4  # keyframes without a match where the hypothesis predicts it


class Verified(NamedTuple):
    """A loop; the share of inliers less conflicts, as the mean of both ways to match.

    Whether it fixes the position in both directions, and whether it is where it was expected.
    """

    edge: LoopEdge
    agreement: float
    is_observed: bool
    fits: bool = True


class Query(NamedTuple):
    """A keyframe, its local map, and the others near which it is searched for.

    Of these the number, the expected pose there and its covariance.
    """

    later: int
    here: LocalMap
    candidates: list[tuple[int, Pose2, Floats]]
    found: list[Verified]
    is_predicted: bool


class LoopDetector:
    """Finds loops in a graph, one candidate for each call of `work`.

    Args:
        graph: poses of the keyframes.
        keyframes: their scans.
        loop_path: path between two visits at least [m].
    """

    def __init__(self, graph: PoseGraph, keyframes: list[Keyframe], loop_path: float) -> None:
        self._graph, self._keyframes, self._loop_path = graph, keyframes, loop_path
        self._query: Query | None = None
        self._hypothesis: list[Verified] = []
        self._checked: list[int] = []  # keyframes that were compared with the hypothesis
        self._against = 0  # of these, without a match there
        self._searched = 0.0  # path at the last query

    def work(self, tries: int = 1) -> list[LoopEdge]:
        """Match with so many candidates at most; returns the loops that are believed now."""
        for _ in range(tries):
            self._query = self._query or self._begin()
            query = self._query
            if query is None:
                break
            self._try(query, *query.candidates.pop(0))
            if not query.candidates:
                self._query = None
                loops = self._conclude(query)
                if loops:
                    return loops
        return []

    def claimed(self, drawn: Sequence[Pose2], at: Pose2) -> LoopEdge | None:
        """The loop by which the last keyframe is `at` in the algorithm's map, if it is one.

        `drawn`: keyframes in that map.
        """
        graph, later = self._graph, self._graph.n - 1
        old = np.flatnonzero(graph.path < graph.path[later] - self._loop_path)
        if old.size == 0:
            return None
        earlier = min(old.tolist(), key=lambda k: math.hypot(drawn[k].x - at.x, drawn[k].y - at.y))
        expected = drawn[earlier].between(at)
        query = Query(later, self._local_map(later), [], [], False)
        known = graph.step(earlier, later), graph.uncertainty(later)[earlier]
        self._try(query, earlier, *known, Window(expected, AMBIGUITY, 2.0 * AGREE_ROTATION))
        best = self._best(query)
        if best is None:
            return None
        off = expected.between(best.edge.pose)  # else the last pose is a scan's that was kept back
        return best.edge if math.hypot(off.x, off.y) < AGREE else None

    def _begin(self) -> Query | None:
        """Search for the last keyframe, if it is far from the one before."""
        graph = self._graph
        if self._hypothesis:
            return self._predicted()
        path = float(graph.path[-1]) - VIEW  # the local map has both sides
        if path - self._searched < SPACING:
            return None
        self._searched = path
        later = int(np.searchsorted(graph.path, path))
        old = np.flatnonzero(graph.path < graph.path[later] - self._loop_path)
        if old.size == 0:
            return None
        covariances = graph.uncertainty(later)[old]
        away = np.hypot(*(graph.poses[old, :2] - graph.poses[later, :2]).T)
        deviation = np.sqrt(covariances[:, 0, 0] + covariances[:, 1, 1])
        chosen = self._nearest(old, away, away < VIEW + DEVIATIONS * deviation)
        if not chosen:
            return None
        certain = bool(deviation[chosen[0]] < CERTAIN)
        candidates = [
            (int(old[k]), graph.step(int(old[k]), later), covariances[k])
            for k in chosen[: 1 if certain else None]
        ]
        return Query(later, self._local_map(later), candidates, [], certain)

    def _predicted(self) -> Query | None:
        """Search for a neighbor of the hypothesis where it predicts it, if one is due."""
        graph, path = self._graph, self._graph.path
        ahead = np.flatnonzero(path >= path[max(self._checked)] + SPACING)
        ahead = ahead[path[ahead] <= path[-1] - VIEW]
        behind = np.flatnonzero(path <= path[min(self._checked)] - SPACING)
        behind = behind[path[behind] > self._loop_path]  # something is older
        if ahead.size:
            later = int(ahead[0])
        elif behind.size and path[self._checked[0]] - path[behind[-1]] < VIEW:
            later = int(behind[-1])
        else:
            return None
        self._checked.append(later)
        edges = [found.edge for found in self._hypothesis]
        last = min(edges, key=lambda edge: abs(path[edge.later] - path[later]))
        pose = graph.pose(last.earlier) @ last.pose @ graph.step(last.later, later)
        old = np.flatnonzero(path < path[later] - self._loop_path)
        away = np.hypot(*(graph.poses[old, :2] - np.array(pose[:2])).T)
        from_last, to_earlier = graph.uncertainty(last.later), graph.uncertainty(last.earlier)
        candidates = [
            (int(k), graph.pose(int(k)).between(pose), from_last[later] + to_earlier[k])
            for k in old[self._nearest(old, away, away <= max(VIEW, away.min()))[:2]]
        ]
        covariance = candidates[0][2]
        if covariance[0, 0] + covariance[1, 1] > AMBIGUITY**2:  # no witness: any place is there
            self._hypothesis = []
            return None
        return Query(later, self._local_map(later), candidates, [], True)

    def _nearest(self, old: NDArray[np.int64], away: Floats, free: NDArray[np.bool_]) -> list[int]:
        """Of the `old` keyframes that are `free` the nearest, of a place one for each direction."""
        chosen: list[int] = []
        while free.any():
            k = int(np.argmin(np.where(free, away, np.inf)))
            chosen.append(k)
            x, y, turn = (self._graph.poses[old] - self._graph.poses[old[k]]).T
            free = free & ((np.hypot(x, y) > VIEW) | (np.cos(turn) < 0.0))
        return chosen

    def _try(
        self,
        query: Query,
        earlier: int,
        expected: Pose2,
        covariance: Floats,
        window: Window | None = None,
    ) -> None:
        """Search the keyframe in the local map of another, and verify."""
        there, window = self._local_map(earlier), window or _window(expected, covariance)
        found = there.search(self._keyframes[query.later].ends, window, MIN_SCORE)
        if found.score >= MIN_SCORE:
            edge = LoopEdge(earlier, query.later, found.pose)
            verified = self._verified(edge, there, query.here, found.spread)
            if verified is not None:
                off = np.array(self._implied(verified.edge))
                off -= self._graph.pose(earlier) @ expected
                off[2] = wrap_angle(float(off[2]))
                noise = covariance + np.diag(np.square(EDGE))
                fits = float(off @ np.linalg.solve(noise, off)) < GATE
                query.found.append(verified._replace(fits=fits))

    def _verified(
        self, edge: LoopEdge, there: LocalMap, here: LocalMap, spread: Floats
    ) -> Verified | None:
        """The match in both directions, if both agree."""
        key, old = self._keyframes[edge.later], self._keyframes[edge.earlier]
        points, middle = read(key.scan, key.twist)
        match = there.fit(points, edge.pose @ middle)
        pose = match.pose @ middle.inverse()
        forward = there.agreement(key.ends, pose)
        if forward < MIN_AGREEMENT:
            return None
        seen = observed(points, pose.theta, spread)
        points, middle = read(old.scan, old.twist)
        back = here.fit(points, pose.inverse() @ middle).pose @ middle.inverse()
        off = pose @ back
        if math.hypot(*(seen @ np.array(off[:2]))) > AGREE or abs(off.theta) > AGREE_ROTATION:
            return None
        backward = here.agreement(old.ends, pose.inverse())
        if backward < MIN_AGREEMENT:
            return None
        information = information_of(match, seen)
        edge = edge._replace(pose=pose, information=information)
        least = float(np.linalg.eigvalsh(information[:2, :2])[0])
        return Verified(edge, 0.5 * (forward + backward), least > AGREE**-2)

    def _local_map(self, middle: int) -> LocalMap:
        """Of the keyframes around one, in its frame."""
        path, chosen = self._graph.path, [middle]
        for side in (range(middle - 1, -1, -1), range(middle + 1, len(path))):
            last = middle
            for k in side:
                if abs(path[k] - path[middle]) > VIEW:
                    break
                if abs(path[k] - path[last]) >= LOCAL_SPACING:
                    chosen.append(k)
                    last = k
        poses = [self._graph.step(middle, k) for k in chosen]
        return LocalMap([self._keyframes[k] for k in chosen], poses)

    def _conclude(self, query: Query) -> list[LoopEdge]:
        """The loops that are believed after all candidates of a keyframe were tried."""
        best = self._best(query)
        if best is not None and not self._hypothesis:
            if query.is_predicted:
                return [best.edge]
            self._checked, self._against = [query.later], 0
        elif all(found.is_observed and not found.fits for found in query.found):
            self._against += 1  # what slides along a corridor is no witness
        if best is not None and best.is_observed:
            self._hypothesis.append(best)
        path = self._graph.path[[found.edge.later for found in self._hypothesis]]
        enough = len(path) >= CONFIRMED and np.ptp(path) >= CONFIRMED * SPACING
        if enough and np.mean([found.agreement for found in self._hypothesis]) >= ALONE:
            loops = [found.edge for found in self._hypothesis]
            self._hypothesis = []
            return loops
        if self._against >= REFUTED:
            self._hypothesis = []
        return []

    def _best(self, query: Query) -> Verified | None:
        """The best match, if none elsewhere is nearly as good."""
        good = [found for found in query.found if found.fits]
        if not query.is_predicted:
            good = [found for found in good if found.is_observed and found.agreement >= ALONE]
        if not good:
            return None
        best = max(good, key=lambda found: found.agreement)
        for found in good:
            off = self._implied(best.edge).between(self._implied(found.edge))
            elsewhere = math.hypot(off.x, off.y) > VIEW
            if elsewhere and best.agreement - found.agreement < MIN_LEAD:
                return None
        return best

    def _implied(self, edge: LoopEdge) -> Pose2:
        return self._graph.pose(edge.earlier) @ edge.pose


def _window(expected: Pose2, covariance: Floats) -> Window:
    """Around the expected pose, as far as the covariance and the local map reach."""
    half = DEVIATIONS * math.sqrt(max(covariance[0, 0], covariance[1, 1])) + 2.0 * EDGE[0]
    rotation = DEVIATIONS * math.sqrt(covariance[2, 2]) + 2.0 * EDGE[2]
    low = [max(v - half, -VIEW) for v in expected[:2]]
    high = [min(v + half, VIEW) for v in expected[:2]]
    x, y = (0.5 * (a + b) for a, b in zip(low, high, strict=True))
    widest = max(AMBIGUITY, *(0.5 * (b - a) for a, b in zip(low, high, strict=True)))
    return Window(Pose2(x, y, expected.theta), widest, rotation)
