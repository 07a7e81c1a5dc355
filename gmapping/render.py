"""The map as a grid: the best particle's history, ray cast when asked for."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gmapping.render_kernels import draw
from slams.types import Floats, OccupancyGrid, Pose2


class Ray(NamedTuple):
    """End points (n, 2 or more) x, y [m] of a scan and the laser (1, 2), in the base frame."""

    points: Floats
    sensor: Floats

    def seen_from(self, pose: Pose2) -> Ray:
        """The same in the frame that `pose` stands in."""
        return Ray(pose.transform(self.points[:, :2]), pose.transform(self.sensor))


class Renderer:
    """Keeps the key scans; draws them at whatever poses a particle's history gives them.

    `resolution` [m] is the edge of a cell; cells with a greater share of hits than `occupied` are
    walls.
    """

    def __init__(self, resolution: float, occupied: float) -> None:
        self._resolution, self._occupied = resolution, occupied
        self._scans: list[Callable[[], Ray]] = []

    def keep(self, scan: Callable[[], Ray]) -> None:
        """Keep a key scan: what gives its rays when they are drawn."""
        self._scans.append(scan)

    def grid(self, history: Floats) -> OccupancyGrid:
        """Occupancy of the cells, from hits and visits; 0.5 is the original's threshold."""
        edge, scans = self._resolution, zip(self._scans, history, strict=True)
        rays = [scan().seen_from(Pose2(*pose.tolist())) for scan, pose in scans]
        ends = [np.zeros((1, 2)), *(ray.points for ray in rays), *(ray.sensor for ray in rays)]
        cells = np.floor(np.concatenate(ends) / edge + 0.5).astype(np.int64)
        corner, far = cells.min(axis=0), cells.max(axis=0)
        width, height = (far - corner + 1).tolist()
        hits, visits = np.zeros((2, height, width), np.int32)
        for points, sensor in rays:
            draw(points, sensor[0], edge, corner, hits, visits)
        power = math.log(0.5) / math.log(self._occupied)
        with np.errstate(invalid="ignore"):
            p = ((hits / visits) ** power).astype(np.float32)
        x, y = ((corner - 0.5) * edge).tolist()
        return OccupancyGrid(p, edge, (x, y))
