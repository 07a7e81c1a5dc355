"""Localizer: an algorithm in a map that stays as it is; its poses are in the map's frame."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from slams.localize.hooks import Localizes
from slams.localize.map_index import MapIndex, end_points
from slams.params import Params
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan, against_map

POOR = 0.5  # share of a scan below which the world has changed, or the robot is elsewhere


class Localizer:
    """A `Slam` around an algorithm whose map is finished.

    The first update takes `start` for the pose of its scan; all others are the algorithm's.
    `explained` is the share of the last scan's beams that the map explains, `quality` the
    algorithm's own.

    Args:
        slam: the algorithm, with its map.
        index: the map that poses are given in.
        start: the base's pose in it at the first scan.
        origin: the algorithm's frame in that of the map.
    """

    Params: ClassVar[type[Params]] = Params

    def __init__(
        self, slam: Localizes, index: MapIndex, start: Pose2, origin: Pose2 = IDENTITY
    ) -> None:
        self.slam = slam
        self.explained = 1.0
        self._index, self._origin = index, origin
        self._start: Pose2 | None = start
        self._scans = self._poor = 0
        self._sum = 0.0
        slam.frozen = True

    @property
    def params(self) -> Any:
        """The algorithm's own."""
        return getattr(self.slam, "params", None)

    def update(self, scan: Scan) -> Pose2:
        """Take the next scan; the base's pose in the map."""
        if self._start is None:
            pose = self._origin @ self.slam.update(scan)
        else:
            pose, self._start = self._start, None
            self.slam.insert_at(scan, self._origin.between(pose))
        self._judge(scan, pose)
        return pose

    def map(self) -> OccupancyGrid:
        """The map it was given."""
        return self._index.grid

    def report(self) -> dict[str, Any]:
        """The algorithm's counts; the mean share explained; scans that are unlike the map."""
        share = self._sum / self._scans if self._scans else math.nan
        return dict(self.slam.report()) | {"explained": round(share, 4), "unlike": self._poor}

    @property
    def state(self) -> Any:
        """The algorithm's own."""
        return getattr(self.slam, "state", None)

    @property
    def quality(self) -> float:
        """The algorithm's own; nan where it has none."""
        return float(getattr(self.slam, "quality", math.nan))

    @property
    def covariance(self) -> Floats:
        """The algorithm's own (3, 3) [m, rad], in the map's frame; inf where it has none."""
        own = against_map(self.slam)
        if own is None:
            return np.diag([math.inf] * 3)
        turn = np.eye(3)
        c, s = math.cos(self._origin.theta), math.sin(self._origin.theta)
        turn[:2, :2] = ((c, -s), (s, c))
        return np.asarray(turn @ np.asarray(own) @ turn.T, np.float64)

    def _judge(self, scan: Scan, pose: Pose2) -> None:
        points = end_points(scan)
        if not len(points):
            return
        self.explained, _ = self._index.distances.evaluate(points, pose @ scan.laser.mount)
        self._scans += 1
        self._sum += self.explained
        self._poor += self.explained < POOR
