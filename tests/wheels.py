"""An algorithm without matching, for tests of what is built around algorithms."""

import numpy as np

import slams
from slams.types import IDENTITY


class Drifting:
    """A `Localizes` whose poses are the wheels'; it notes the scans that are given a pose.

    `inserted` are those of its map, `places` those after the map was finished.
    """

    Params = slams.Params

    def __init__(self, params):
        self.params, self.frozen = params, False
        self._first = self._origin = None
        self.inserted, self.places, self.used = [], [], 0

    def update(self, scan):
        if self._origin is None:
            self._first, self._origin = scan.odometry, IDENTITY
        if scan.odometry is None:
            return self._origin
        self.used += 1
        return self._origin @ self._first.between(scan.odometry)

    def insert_at(self, scan, pose):
        self._first, self._origin = scan.odometry, pose
        (self.places if self.frozen else self.inserted).append((scan, pose))

    def map(self):
        return slams.OccupancyGrid(np.full((1, 1), np.nan, np.float32), 0.05, (0.0, 0.0))

    def report(self):
        return {"odometry": self.used}
