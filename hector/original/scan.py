"""EndPoints: the end points of the scan at hand."""

from __future__ import annotations

import math

import numpy as np

from hector.original.params import OriginalParams
from slams.scan.leveling import floor_of
from slams.scan.scan_kernels import deskew, end_points
from slams.scan.tilt_kernels import level
from slams.types import Attitude, Laser, Pose2, Scan


class EndPoints:
    """Buffers for the scans of one laser: `points` (3, >= n) has x, y [m], number of the beam."""

    def __init__(self, params: OriginalParams, laser: Laser) -> None:
        self.laser = laser
        self.n = 0
        self.has_sweep = params.deskew and laser.time_increment > 0.0
        self._limits = max(params.min_range, laser.range_min), params.max_range
        # behind the laser nearer ranges are those of the robot's own body
        self._body = np.where(laser.directions[:, 0] < 0.0, params.body_radius, 0.0)
        self.points = np.zeros((4, laser.n_beams))

    def read(self, scan: Scan, velocity: Pose2) -> None:
        """Read a scan; `velocity` of the base [m/s, rad/s] is used where scans are deskewed."""
        laser = self.laser
        ranges = np.where(scan.ranges < self._body, np.float32(np.nan), scan.ranges)
        fan = laser.directions, laser.mount, self._limits
        self.n, _ = end_points(ranges, *fan, 0.0, self.points)
        if scan.attitude is not None:
            self._level(scan.attitude)
        if self.has_sweep:
            deskew(self.points, self.n, velocity, laser.time_increment, 0.0)  # to the first beam

    def _level(self, attitude: Attitude) -> None:
        """Level the points as the node's stabilized frame does, without a check for the floor."""
        floor = floor_of(self.laser)._replace(below=math.inf)
        tilt = attitude.rotation(), np.zeros((3, 3)), 0.0, floor
        self.n, _ = level(self.points, self.n, *tilt, self.points, np.zeros(4))
