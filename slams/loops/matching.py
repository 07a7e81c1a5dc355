"""Match a keyframe with the local map of other keyframes, from a pose known to meters only."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np

from slams.frontend.correlative import LikelihoodField, Window, search
from slams.frontend.degeneracy import scan_observability
from slams.geometry import Prior
from slams.loops.visibility_kernels import CONFLICT, INLIER, check_visibility
from slams.refine.lines import LineMap, Match
from slams.refine.params import RefineParams
from slams.scan.end_points import EndPoints
from slams.types import IDENTITY, Floats, Pose2, Scan

LOCAL_MAP_CELL = 0.1  # m, edge of a cell of the likelihood field and of the lines
ADJACENT_CELL_LIKELIHOOD = 0.6  # of the cells next to one with an end point, which has 1
MAX_LOCAL_MAP_RANGE = 15.0  # m: farther end points are too far apart to draw a wall
LOCAL_MAP_PARAMS = RefineParams()  # defaults, so that no setting of the algorithm changes loops
MAX_POSITION_SPREAD = 0.3  # m, deviation of near-best positions; beyond it an axis is degenerate
NEAR_BEST_MARGIN = 0.05  # of likelihood: poses with at most so much less match equally well
LOOP_EDGE_STD = 0.01, 0.01, 0.003  # m, m, rad: deviations of a loop in addition to its fit
MIN_LOOP_INFORMATION = 1e-4  # 1/m^2, 1/rad^2: kept along a degenerate direction
START_INFORMATION = np.diag((LOCAL_MAP_CELL**-2, LOCAL_MAP_CELL**-2, 0.03**-2))  # 1/m^2, 1/rad^2


class Keyframe(NamedTuple):
    """A scan of the graph, the body twist during it [m/s, rad/s], and its end points (2, n) [m].

    End points are in the base frame at the stamp, and only those within `MAX_LOCAL_MAP_RANGE`.
    """

    scan: Scan
    twist: Pose2
    ends: Floats


class SearchResult(NamedTuple):
    """The best pose of a search, its likelihood 0..1, spread (2, 2) [m^2] of near-best poses."""

    pose: Pose2
    likelihood: float
    spread: Floats


def read_end_points(scan: Scan, twist: Pose2) -> tuple[EndPoints, Pose2]:
    """End points of a scan, and the pose of their frame in the base frame at the stamp."""
    points = EndPoints(LOCAL_MAP_PARAMS).read(scan, twist)
    return points, points.at_stamp(IDENTITY).inverse()


def keyframe(scan: Scan, twist: Pose2) -> Keyframe:
    """The keyframe of a scan: its end points are deskewed by the body twist [m/s, rad/s]."""
    points, frame = read_end_points(scan, twist)
    ends = frame.transform(points.points[:2, : points.n].T).T
    near = np.hypot(ends[0], ends[1]) < MAX_LOCAL_MAP_RANGE
    return Keyframe(scan, twist, np.ascontiguousarray(ends[:, near]))


class LocalMap:
    """Likelihood field and wall lines around a keyframe, drawn from it and its neighbors.

    Args:
        keyframes: the keyframes that the map is drawn from.
        poses: their poses in the frame of the map.
    """

    def __init__(self, keyframes: Sequence[Keyframe], poses: Sequence[Pose2]) -> None:
        self.keyframes, self.poses = keyframes, poses
        ends = [pose.transform(k.ends.T).T for pose, k in zip(poses, keyframes, strict=True)]
        all_ends = np.ascontiguousarray(np.concatenate(ends, axis=1))
        low = all_ends.min(axis=1) - 2.0 * LOCAL_MAP_CELL
        high = all_ends.max(axis=1) + 2.0 * LOCAL_MAP_CELL
        nx, ny = (np.ceil((high - low) / LOCAL_MAP_CELL).astype(int) + 1).tolist()
        walls = np.zeros((ny, nx), np.float32)
        ix, iy = np.floor((all_ends - low[:, None]) / LOCAL_MAP_CELL + 0.5).astype(int)
        walls[iy, ix] = 1.0
        adjacent = np.asarray(cv2.dilate(walls, np.ones((3, 3), np.uint8)), np.float32)
        likelihood = np.maximum(walls, ADJACENT_CELL_LIKELIHOOD * adjacent)
        x0, y0 = low.tolist()
        self._field = LikelihoodField(likelihood, x0, y0, LOCAL_MAP_CELL)

    def search(self, ends: Floats, window: Window, min_likelihood: float) -> SearchResult:
        """The best pose of a window for end points (2, n) [m]; likelihood 0 below the minimum."""
        poses, _ = search(self._field, ends, window, min_likelihood, NEAR_BEST_MARGIN)
        if len(poses) == 0:
            return SearchResult(window.middle, 0.0, np.zeros((2, 2)))
        best = poses[0]
        offsets = poses[poses[:, 3] > best[3] - NEAR_BEST_MARGIN, :2] - best[:2]
        spread = offsets.T @ offsets / len(offsets)
        return SearchResult(Pose2(*best[:3].tolist()), float(best[3]), spread)

    def fit(self, points: EndPoints, start: Pose2) -> Match:
        """Gauss-Newton on the lines of the local map, from a pose that is right to a cell."""
        return self._lines.fit(points, start, Prior(start, START_INFORMATION))

    def match_score(self, ends: Floats, pose: Pose2) -> float:
        """Inlier ratio less the ratio of free-space conflicts, of end points (2, n) at a pose."""
        seen = np.zeros(ends.shape[1], np.uint8)
        for other, at in zip(self.keyframes, self.poses, strict=True):
            laser = other.scan.laser
            fan = laser.angle_min, laser.angle_increment, laser.range_max
            ranges = other.scan.ranges.astype(np.float64)
            check_visibility(ends, (at @ laser.mount).between(pose), ranges, fan, seen)
        inliers, conflicts = np.count_nonzero(seen & INLIER), np.count_nonzero(seen == CONFLICT)
        return float(inliers - conflicts) / max(len(seen), 1)

    @cached_property
    def _lines(self) -> LineMap:
        likelihood, x0, y0, *_ = self._field
        cells = np.zeros_like(likelihood)  # none of them counts as free
        lines = LineMap(LOCAL_MAP_PARAMS, cells, (x0, y0), LOCAL_MAP_CELL, free=-math.inf)
        for key, pose in zip(self.keyframes, self.poses, strict=True):
            points, frame = read_end_points(key.scan, key.twist)
            lines.insert(points, pose @ frame)
        return lines


def observable_part(points: EndPoints, theta: float, spread: Floats) -> Floats:
    """Projection (2, 2) of a position onto the directions that a match observes.

    Degenerate directions follow from the normals of the scan [Zhang16], and from `spread`.

    Args:
        points: the scan.
        theta: its heading [rad] in the frame of the result.
        spread: (2, 2) [m^2] of `SearchResult`.
    """
    observed = scan_observability(points, theta, position_measured=True)
    worst = np.array((observed.x, observed.y))
    projection: Floats = np.eye(2) - (1.0 - observed.share) * np.outer(worst, worst)
    squares, axes = np.linalg.eigh(spread)
    for square, axis in zip(squares, axes.T, strict=True):
        if square > MAX_POSITION_SPREAD**2:
            projection = projection @ (np.eye(2) - np.outer(axis, axis))
    return projection


def loop_information(match: Match, projection: Floats) -> Floats:
    """Information (3, 3) of a loop: that of its fit, projected by (2, 2) onto observed positions.

    ours: the fit's covariance counts nine times, as the errors of its beams are correlated.
    """
    noise = np.diag(np.square(LOOP_EDGE_STD))
    fit = match.information + np.diag((MIN_LOOP_INFORMATION,) * 3)
    P = np.eye(3)
    P[:2, :2] = projection
    information = np.linalg.inv(9.0 * np.linalg.inv(fit) + noise)
    return P.T @ information @ P + np.diag((MIN_LOOP_INFORMATION, MIN_LOOP_INFORMATION, 0.0))
