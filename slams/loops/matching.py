"""Matching a keyframe with the local map of some others, from a pose known to meters only.

[Olson15] E. Olson: M3RSM: Many-to-Many Multi-Resolution Scan Matching. ICRA 2015.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slams.frontend.degeneracy import of_scan
from slams.geometry import Prior
from slams.loops import matching_kernels as kernels
from slams.refine.lines import LineMap, Match
from slams.refine.params import RefineParams
from slams.scan.end_points import EndPoints
from slams.types import IDENTITY, Floats, Pose2, Scan

CELL = 0.1  # m, of the likelihood and of the lines
BLOCKS = 4, 8  # cells along the edge of a coarse one, in a small and in a wide window
WIDE = 2.0  # m, half of a window that is wide
FAR = 15.0  # m: farther end points are too sparse to draw a map of
BEAMS = 60  # of a scan that are searched with
ROTATION_STEP = 0.015  # rad to each cell of a block: moves a wall 7 m away by as much
GOLDEN = 0.618034  # ratio that leads each point far from those before
REFINED = 40  # coarse poses that are searched finely
TOLERANCE = 0.15  # m, between the ranges of two keyframes that see one wall
SCANS = RefineParams()  # how scans are read and lines drawn, whatever the algorithm does
AMBIGUOUS = 0.3  # m, deviation of poses that match as well, along a corridor
ALIKE = 0.05  # of the score: poses that match nearly as well
STARTED = np.diag((CELL**-2, CELL**-2, 0.03**-2))  # information of a start [1/m^2, 1/rad^2]


class Keyframe(NamedTuple):
    """A scan of the graph, the body twist during it [m/s, rad/s], and its end points (2, n) [m].

    End points are in the base frame at the stamp of the scan; those too far to draw a map are left
    out.
    """

    scan: Scan
    twist: Pose2
    ends: Floats


class Window(NamedTuple):
    """Where a pose is searched for: its middle, half its width [m] and half its rotation [rad]."""

    middle: Pose2
    half: float
    rotation: float


class Found(NamedTuple):
    """The best pose of a search and its score 0..1.

    `spread` (2, 2) [m^2] of the poses that score nearly as well; how many cells were looked up.
    """

    pose: Pose2
    score: float
    spread: Floats
    lookups: int


def read(scan: Scan, twist: Pose2) -> tuple[EndPoints, Pose2]:
    """End points of a scan, and their frame in that of the base at the stamp."""
    points = EndPoints(SCANS).take(scan, twist)
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
        self.keyframes, self.poses = keyframes, poses
        ends = [pose.transform(k.ends.T).T for pose, k in zip(poses, keyframes, strict=True)]
        every = np.ascontiguousarray(np.concatenate(ends, axis=1))
        low, high = every.min(axis=1) - 2.0 * CELL, every.max(axis=1) + 2.0 * CELL
        nx, ny = (np.ceil((high - low) / CELL).astype(int) + 1).tolist()
        self._first = (float(low[0]), float(low[1]))  # center of cell [0, 0]
        self._fine = np.zeros((ny, nx), np.float32)
        kernels.paint(every, *self._first, CELL, self._fine)
        self._lines: LineMap | None = None

    def search(self, ends: Floats, window: Window, enough: float) -> Found:
        """Multi-resolution correlative search for a pose with a score of `enough` [Olson15].

        Coarse cells bound what their poses can score; the best of them are searched finely.
        """
        some = ends[:, :: max(1, ends.shape[1] // BEAMS)]
        far_apart = np.argsort(np.arange(some.shape[1]) * GOLDEN % 1.0)  # bad poses fail early
        some = np.ascontiguousarray(some[:, far_apart])
        cells = BLOCKS[window.half > WIDE]
        poses, count = self._coarse_poses(some, window, cells, enough)
        frame = np.array((*self._first, CELL))
        kernels.finest(self._fine, some, frame, cells, np.array((enough, ALIKE)), poses)
        tried = int((poses[:, 3] > 0.0).sum())
        lookups = (count + tried * cells * cells) * some.shape[1]
        if len(poses) == 0:
            return Found(window.middle, 0.0, np.zeros((2, 2)), lookups)
        top = poses[int(np.argmax(poses[:, 3]))]
        off = poses[poses[:, 3] > top[3] - ALIKE, :2] - top[:2]
        return Found(Pose2(*top[:3].tolist()), float(top[3]), off.T @ off / len(off), lookups)

    def _coarse_poses(
        self, ends: Floats, window: Window, cells: int, enough: float
    ) -> tuple[Floats, int]:
        """The first poses (k, 4) of the best blocks of a window, and how many blocks it has."""
        (ny, nx), block = self._fine.shape, CELL * cells
        coarse = np.zeros((ny // cells + 1, nx // cells + 1), np.float32)
        kernels.pool(self._fine, cells, coarse)
        shifts = 2 * math.ceil(window.half / block) + 1
        rotation = min(window.rotation, math.pi)
        rotations = 2 * math.ceil(rotation / (ROTATION_STEP * cells)) + 1
        step = 2.0 * rotation / (rotations - 1)
        x, y = (v - 0.5 * (shifts - 1) * block for v in window.middle[:2])
        first = window.middle.theta - rotation
        bounds = np.zeros((rotations, shifts, shifts), np.float32)
        corner = np.array(self._first) - 0.5 * CELL
        view = np.array((x, y, first, step, block, enough))
        kernels.bounds(coarse, ends, view, corner, bounds)
        good = np.flatnonzero(bounds >= enough)
        good = good[np.argsort(-bounds.flat[good], kind="stable")[:REFINED]]
        k, j, i = np.unravel_index(good, bounds.shape)
        turns = np.arange(-(cells // 4), cells // 4 + 1) / (cells // 2 + 1)
        thetas = (first + (k[:, None] + turns) * step).ravel()
        xs, ys = (np.repeat(v, len(turns)) for v in (x + i * block, y + j * block))
        bound = np.repeat(bounds.flat[good], len(turns))
        poses = np.ascontiguousarray(np.stack([xs, ys, thetas, bound], axis=1), np.float64)
        return poses, bounds.size

    def fit(self, points: EndPoints, start: Pose2) -> Match:
        """Gauss-Newton on the lines of the local map, from a pose good to a cell."""
        if self._lines is None:
            self._lines = self._drawn()
        return self._lines.fit(points, start, Prior(start, STARTED))

    def agreement(self, ends: Floats, pose: Pose2) -> float:
        """Share of the end points that its keyframes see too, less those that they see through."""
        found = np.zeros(ends.shape[1])
        for other, at in zip(self.keyframes, self.poses, strict=True):
            laser = other.scan.laser
            seen_from = (at @ laser.mount).between(pose)
            view = np.array((laser.angle_min, laser.angle_increment, laser.range_max))
            ranges = other.scan.ranges
            kernels.visible(ends, np.array(seen_from), ranges, view, TOLERANCE, found)
        return float(found.mean()) if found.size else 0.0

    def _drawn(self) -> LineMap:
        seen = np.zeros_like(self._fine)  # nothing is known to be free
        lines = LineMap(SCANS, seen, self._first, CELL)
        for key, pose in zip(self.keyframes, self.poses, strict=True):
            points, middle = read(key.scan, key.twist)
            lines.insert(points, pose @ middle)
        return lines


def observed(points: EndPoints, theta: float, spread: Floats) -> Floats:
    """What a match observes of a position (2, 2): the identity, or a projection across a corridor.

    By the normals of the scan [Zhang16], and by the `spread` of poses that match as well.

    Args:
        points: the scan.
        theta: its heading [rad] in the frame of the result.
        spread: (2, 2) [m^2].
    """
    seen = of_scan(points, theta, known_otherwise=True)
    blind = np.array((seen.x, seen.y))
    projection: Floats = np.eye(2) - (1.0 - seen.share) * np.outer(blind, blind)
    squares, axes = np.linalg.eigh(spread)
    for square, axis in zip(squares, axes.T, strict=True):
        if square > AMBIGUOUS**2:
            projection = projection @ (np.eye(2) - np.outer(axis, axis))
    return projection
