"""The map as a grid: the best particle's history, ray cast when asked for."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gmapping.render_kernels import draw
from slams.types import Floats, OccupancyGrid, Pose2

LAG = 50  # key scans, farther back than particles of one map usually disagree
SPARE = 64  # cells added beyond what does not fit


class Ray(NamedTuple):
    """End points (n, 2 or more) x, y [m] of a scan and the laser (1, 2), in the base frame."""

    points: Floats
    sensor: Floats

    def seen_from(self, pose: Pose2) -> Ray:
        """The same in the frame that `pose` stands in."""
        return Ray(pose.transform(self.points[:, :2]), pose.transform(self.sensor))


class Ends(NamedTuple):
    """What of a key scan is kept: end points (n, 2) x, y [m], and the laser's mount."""

    points: NDArray[np.float32]
    mount: Pose2

    def ray(self) -> Ray:
        """What is drawn of it."""
        return Ray(self.points.astype(np.float64), np.array([[self.mount.x, self.mount.y]]))


class Counts:
    """How often beams ended in a cell, and how often one came by, in a grid that grows with them.

    `edge` [m] is that of a cell; the start is always inside.
    """

    def __init__(self, edge: float) -> None:
        self._edge = edge
        self._low, self._high = np.zeros((2, 2), np.int64)  # cells that were needed, both included
        self._corner = self._low - SPARE
        self._hits, self._visits = np.zeros((2, 2 * SPARE, 2 * SPARE), np.int32)

    def add(self, ray: Ray) -> None:
        """Draw a scan that stands in the frame of the map."""
        cells = np.floor(np.concatenate([ray.points, ray.sensor]) / self._edge + 0.5)
        self._low = np.minimum(self._low, cells.min(axis=0).astype(np.int64))
        self._high = np.maximum(self._high, cells.max(axis=0).astype(np.int64))
        size = np.array(self._hits.shape[::-1])
        before = np.where(self._low < self._corner, self._corner - self._low + SPARE, 0)
        after = np.maximum(self._high + 1 - self._corner - size, 0)
        after += np.where(after > 0, SPARE, 0)
        if before.any() or after.any():
            pad = (before[1], after[1]), (before[0], after[0])
            self._hits, self._visits = np.pad(self._hits, pad), np.pad(self._visits, pad)
            self._corner = self._corner - before
        draw(ray.points, ray.sensor[0], self._edge, self._corner, self._hits, self._visits)

    def shares(self) -> tuple[Floats, tuple[float, float]]:
        """Hits per visit of the cells that were needed, nan without; their outer corner [m]."""
        (x0, y0), (x1, y1) = self._low - self._corner, self._high - self._corner + 1
        with np.errstate(invalid="ignore"):
            shares = self._hits[y0:y1, x0:x1] / self._visits[y0:y1, x0:x1]
        x, y = ((self._low - 0.5) * self._edge).tolist()
        return shares, (x, y)

    def copy(self) -> Counts:
        """The same, to draw on."""
        other = Counts(self._edge)
        other.__dict__ |= self.__dict__
        other._hits, other._visits = self._hits.copy(), self._visits.copy()
        return other


class Renderer:
    """Keeps the key scans; draws them at whatever poses a particle's history gives them.

    `resolution` [m] is the edge of a cell; cells with a greater share of hits than `occupied` are
    walls. What lies `LAG` key scans back seldom changes: it is drawn once, and again if it does.
    """

    def __init__(self, resolution: float, occupied: float) -> None:
        self._resolution, self._occupied = resolution, occupied
        self._scans: list[Callable[[], Ray]] = []
        self._final, self._n_final = Counts(resolution), 0  # scans that are drawn for good
        self._settled = self._final
        self._poses: Floats = np.zeros((0, 3))  # of the scans in `_settled` after those

    def keep(self, scan: Callable[[], Ray]) -> None:
        """Keep a key scan: what gives its rays when they are drawn."""
        self._scans.append(scan)

    def draw(self, scan: Callable[[], Ray], pose: Floats) -> None:
        """Draw a key scan for good, at a pose (3,) that no resampling can change; before any kept.

        Nothing of it is kept.
        """
        self._final.add(scan().seen_from(Pose2(*pose.tolist())))
        self._n_final += 1

    def grid(self, history: Floats) -> OccupancyGrid:
        """Occupancy of the cells, from hits and visits; 0.5 is the original's threshold."""
        history = history[self._n_final :]
        done = len(self._poses)
        if not np.array_equal(history[:done], self._poses):
            self._settled, done = self._final.copy(), 0
        elif self._settled is self._final and len(self._scans) > LAG:
            self._settled = self._final.copy()
        settled = max(len(history) - LAG, done)
        self._add(self._settled, history, done, settled)
        self._poses = history[:settled].copy()
        counts = self._settled.copy()
        self._add(counts, history, settled, len(history))
        shares, corner = counts.shares()
        power = math.log(0.5) / math.log(self._occupied)
        return OccupancyGrid((shares**power).astype(np.float32), self._resolution, corner)

    def _add(self, counts: Counts, history: Floats, first: int, last: int) -> None:
        poses = history[first:last].tolist()
        for scan, pose in zip(self._scans[first:last], poses, strict=True):
            counts.add(scan().seen_from(Pose2(*pose)))
