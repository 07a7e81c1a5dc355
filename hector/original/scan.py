"""EndPoints: the end points of the scan at hand."""

from __future__ import annotations

import math

import numpy as np

from hector.original import scan_kernels as kernels
from hector.original.params import OriginalParams
from hector.original.scan_kernels import Limits, Twist
from slams.scan.leveling import floor_of
from slams.scan.tilt_kernels import level
from slams.types import Attitude, Laser, Pose2, Scan


class EndPoints:
    """Buffers for the scans of one laser: `points` (3, >= n) has x, y [m], number of the beam."""

    def __init__(self, params: OriginalParams, laser: Laser) -> None:
        self.laser = laser
        self.n = 0
        self.has_sweep = params.deskew and laser.time_increment > 0.0
        near = max(params.min_range, laser.range_min)
        self._limits = Limits(near, params.max_range, params.body_radius)
        self.points = np.zeros((3, laser.n_beams))

    def read(self, scan: Scan, velocity: Pose2) -> None:
        """Read a scan; `velocity` of the base [m/s, rad/s] is used where scans are deskewed."""
        laser = self.laser
        self.n = kernels.end_points(
            scan.ranges, laser.directions, laser.mount, self._limits, self.points
        )
        if scan.attitude is not None:
            self._level(scan.attitude)
        if self.has_sweep:
            twist = Twist(velocity.x, velocity.y, velocity.theta, laser.time_increment)
            kernels.deskew(self.points, self.n, twist)

    def _level(self, attitude: Attitude) -> None:
        """Level the points as the node's stabilized frame does, without a check for the floor."""
        floor = floor_of(self.laser)._replace(below=math.inf)
        tilt = attitude.rotation(), np.zeros((3, 3)), 0.0, floor
        self.n, _ = level(self.points, self.n, *tilt, self.points, np.zeros(4))
