"""Localizer: an algorithm in a given map, which does not change; poses in the map's frame."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from slams.localize.hooks import Localizes
from slams.localize.map_index import MapIndex, end_points
from slams.params import Params
from slams.player import counts_since
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan, against_map

UNLIKE_INLIER_RATIO = 0.5  # of a scan; below it the world has changed or the pose is wrong


class Localizer:
    """A `Slam` around an algorithm whose map is finished.

    The first update returns `start`, the others the pose of the algorithm. `explained` is the
    inlier ratio of the last scan in the map, `quality` that of the algorithm.

    Args:
        slam: the algorithm, with its map.
        index: the map in whose frame poses are returned.
        start: the base's pose in the map at the first scan.
        origin: the algorithm's frame in the map's frame.
    """

    Params: ClassVar[type[Params]] = Params

    def __init__(
        self, slam: Localizes, index: MapIndex, start: Pose2, origin: Pose2 = IDENTITY
    ) -> None:
        self.slam = slam
        self.explained = 1.0
        self._index, self._origin = index, origin
        self._start: Pose2 | None = start
        self._scans = self._n_unlike = 0
        self._explained_sum = 0.0
        self._before = dict(slam.report())  # counts of the drive that made the map
        slam.frozen = True

    @property
    def params(self) -> Any:
        """Parameters of the algorithm; no attribute if it has none."""
        slam: Any = self.slam
        return slam.params

    def update(self, scan: Scan) -> Pose2:
        """Pose of the base in the map at the next scan."""
        if self._start is None:
            pose = self._origin @ self.slam.update(scan)
        else:
            pose, self._start = self._start, None
            self.slam.insert_at(scan, self._origin.between(pose))
        self._evaluate(scan, pose)
        return pose

    def map(self) -> OccupancyGrid:
        """The given map."""
        return self._index.grid

    def report(self) -> dict[str, Any]:
        """The algorithm's counts in the map, mean of `explained`, number of unlike scans."""
        share = self._explained_sum / self._scans if self._scans else math.nan
        report = counts_since(self._before, self.slam.report())
        return report | {"explained": round(share, 4), "unlike": self._n_unlike}

    @property
    def state(self) -> Any:
        """State of the algorithm."""
        return getattr(self.slam, "state", None)

    @property
    def quality(self) -> float:
        """Quality of the algorithm's last match; nan if it has none."""
        return float(getattr(self.slam, "quality", math.nan))

    @property
    def covariance(self) -> Floats:
        """The algorithm's covariance (3, 3) [m, rad] in the map's frame; inf if it has none."""
        own = against_map(self.slam)
        if own is None:
            return np.diag([math.inf] * 3)
        rotation = np.eye(3)
        c, s = math.cos(self._origin.theta), math.sin(self._origin.theta)
        rotation[:2, :2] = ((c, -s), (s, c))
        return np.asarray(rotation @ np.asarray(own) @ rotation.T, np.float64)

    def _evaluate(self, scan: Scan, pose: Pose2) -> None:
        """Count a scan by its inlier ratio in the map."""
        points = end_points(scan)
        if not len(points):
            return
        self.explained, _ = self._index.distances.evaluate(points, pose @ scan.laser.mount)
        self._scans += 1
        self._explained_sum += self.explained
        self._n_unlike += self.explained < UNLIKE_INLIER_RATIO
