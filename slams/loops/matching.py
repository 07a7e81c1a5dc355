"""Matching a keyframe with the local map of some others, from a pose known to meters only.

[LuMilios97] F. Lu, E. Milios: Globally Consistent Range Scan Alignment for Environment Mapping.
Autonomous Robots 4, 1997.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.frontend.correlative import LikelihoodField, Window, search
from slams.frontend.degeneracy import scan_observability
from slams.geometry import Prior
from slams.refine.lines import LineMap, Match
from slams.refine.params import RefineParams
from slams.scan.end_points import EndPoints
from slams.types import IDENTITY, Floats, Pose2, Scan

CELL = 0.1  # m, of the likelihood and of the lines
BESIDE = 0.6  # likelihood of a cell beside that of a wall
FAR = 15.0  # m: farther end points are too sparse to draw a map of
TOLERANCE = 0.15  # m, between the ranges of two keyframes that see one wall
SCANS = RefineParams()  # how scans are read and lines drawn, whatever the algorithm does
AMBIGUOUS = 0.3  # m, deviation of poses that match as well, along a corridor
ALIKE = 0.05  # of the score: poses that match nearly as well
EDGE = 0.01, 0.01, 0.003  # m, m, rad: deviations of a loop that is observed well
CORRELATED = 9.0  # times the variance of a fit whose beams err independently
BLIND = 1e-4  # 1/m^2: information along a direction that was not observed
STARTED = np.diag((CELL**-2, CELL**-2, 0.03**-2))  # information of a start [1/m^2, 1/rad^2]


class Keyframe(NamedTuple):
    """A scan of the graph, the body twist during it [m/s, rad/s], and its end points (2, n) [m].

    End points are in the base frame at the stamp of the scan; those too far to draw a map are left
    out.
    """

    scan: Scan
    twist: Pose2
    ends: Floats


class Found(NamedTuple):
    """The best pose of a search and its score 0..1.

    `spread` (2, 2) [m^2] of the poses that score nearly as well.
    """

    pose: Pose2
    score: float
    spread: Floats


def read(scan: Scan, twist: Pose2) -> tuple[EndPoints, Pose2]:
    """End points of a scan, and their frame in that of the base at the stamp."""
    points = EndPoints(SCANS).read(scan, twist)
    return points, points.at_stamp(IDENTITY).inverse()


def keyframe(scan: Scan, twist: Pose2) -> Keyframe:
    """A scan made ready for the graph."""
    points, middle = read(scan, twist)
    ends = middle.transform(points.points[:2, : points.n].T).T
    near = np.hypot(ends[0], ends[1]) < FAR
    return Keyframe(scan, twist, np.ascontiguousarray(ends[:, near]))


class LocalMap:
    """Likelihood and lines of walls around a keyframe, drawn from it and its neighbors.

    Args:
        keyframes: of which it is drawn.
        poses: of these, in the frame of the map.
    """

    def __init__(self, keyframes: Sequence[Keyframe], poses: Sequence[Pose2]) -> None:
        import cv2

        self.keyframes, self.poses = keyframes, poses
        ends = [pose.transform(k.ends.T).T for pose, k in zip(poses, keyframes, strict=True)]
        every = np.ascontiguousarray(np.concatenate(ends, axis=1))
        low, high = every.min(axis=1) - 2.0 * CELL, every.max(axis=1) + 2.0 * CELL
        nx, ny = (np.ceil((high - low) / CELL).astype(int) + 1).tolist()
        walls = np.zeros((ny, nx), np.float32)
        ix, iy = np.floor((every - low[:, None]) / CELL + 0.5).astype(int)
        walls[iy, ix] = 1.0
        beside = np.asarray(cv2.dilate(walls, np.ones((3, 3), np.uint8)), np.float32)
        x0, y0 = low.tolist()
        self._lookup = LikelihoodField(np.maximum(walls, BESIDE * beside), x0, y0, CELL)

    def search(self, ends: Floats, window: Window, enough: float) -> Found:
        """The best pose of a window for end points (2, n) [m]; `enough`: a score it must have."""
        poses, _ = search(self._lookup, ends, window, enough, ALIKE)
        if len(poses) == 0:
            return Found(window.middle, 0.0, np.zeros((2, 2)))
        top = poses[0]
        off = poses[poses[:, 3] > top[3] - ALIKE, :2] - top[:2]
        return Found(Pose2(*top[:3].tolist()), float(top[3]), off.T @ off / len(off))

    def fit(self, points: EndPoints, start: Pose2) -> Match:
        """Gauss-Newton on the lines of the local map, from a pose good to a cell."""
        return self._lines.fit(points, start, Prior(start, STARTED))

    def agreement(self, ends: Floats, pose: Pose2) -> float:
        """Share of the end points that its keyframes see too, less those that they see through."""
        seen, through = np.zeros((2, ends.shape[1]), np.bool_)
        for other, at in zip(self.keyframes, self.poses, strict=True):
            placed = (at @ other.scan.laser.mount).between(pose).transform(ends.T)
            here, beyond = visible(placed, other.scan)
            seen, through = seen | here, through | beyond
        return float(seen.sum() - (through & ~seen).sum()) / max(len(seen), 1)

    @cached_property
    def _lines(self) -> LineMap:
        likelihood, x0, y0, *_ = self._lookup
        seen = np.zeros_like(likelihood)
        lines = LineMap(SCANS, seen, (x0, y0), CELL, free=-math.inf)  # no cell is
        for key, pose in zip(self.keyframes, self.poses, strict=True):
            points, middle = read(key.scan, key.twist)
            lines.insert(points, pose @ middle)
        return lines


def visible(points: Floats, scan: Scan) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which points (n, 2) [m] in the frame of a laser its scan has seen, and seen through.

    [LuMilios97] A point between the ranges of the neighboring beams was seen; where all of these
    went farther it was seen through; a hidden point is neither.
    """
    laser, (x, y) = scan.laser, points.T
    ranges = np.minimum(scan.ranges.astype(float), laser.range_max)
    ranges = np.pad(ranges, 1, constant_values=math.nan)
    beams = ranges[:-2], ranges[1:-1], ranges[2:]
    low, high = (np.append(of.reduce(beams), math.nan) for of in (np.fmin, np.fmax))
    turn = np.copysign(1.0, laser.angle_increment) * (np.arctan2(y, x) - laser.angle_min)
    beam = (turn % (2.0 * math.pi) / abs(laser.angle_increment) + 0.5).astype(int)
    low, high = (side[np.minimum(beam, len(scan.ranges))] for side in (low, high))
    r = np.sqrt(x * x + y * y)
    near = TOLERANCE + abs(laser.angle_increment) * r
    seen = (low < laser.range_max) & (low - near <= r) & (r <= high + near)
    return seen, (high > 0.0) & (r < low - near)


def observed(points: EndPoints, theta: float, spread: Floats) -> Floats:
    """What a match observes of a position (2, 2): the identity, or a projection across a corridor.

    By the normals of the scan [Zhang16], and by the `spread` of poses that match as well.

    Args:
        points: the scan.
        theta: its heading [rad] in the frame of the result.
        spread: (2, 2) [m^2].
    """
    seen = scan_observability(points, theta, position_measured=True)
    blind = np.array((seen.x, seen.y))
    projection: Floats = np.eye(2) - (1.0 - seen.share) * np.outer(blind, blind)
    squares, axes = np.linalg.eigh(spread)
    for square, axis in zip(squares, axes.T, strict=True):
        if square > AMBIGUOUS**2:
            projection = projection @ (np.eye(2) - np.outer(axis, axis))
    return projection


def information_of(match: Match, seen: Floats) -> Floats:
    """Of a loop (3, 3): what the fit says of it, as far as the position is `seen` (2, 2)."""
    noise = np.diag(np.square(EDGE))
    scan = match.information + np.diag((BLIND, BLIND, BLIND))
    projection = np.eye(3)
    projection[:2, :2] = seen
    information = np.linalg.inv(CORRELATED * np.linalg.inv(scan) + noise)
    return projection.T @ information @ projection + np.diag((BLIND, BLIND, 0.0))
