"""EndPoints: the end points of the scan at hand."""

from __future__ import annotations

import numpy as np

from hector.original import scan_kernels as kernels
from hector.original.params import OriginalParams
from hector.original.scan_kernels import Limits, Twist
from slams.types import Laser, Pose2, Scan


class EndPoints:
    """Buffers for the scans of one laser: `points` (3, >= n), x, y [m], number of the beam."""

    def __init__(self, params: OriginalParams, laser: Laser) -> None:
        self.laser = laser
        self.n = 0
        self.sweeps = params.deskew and laser.time_increment > 0.0
        near = max(params.min_range, laser.range_min)
        self._limits = Limits(near, params.max_range, params.body_radius)
        self.points = np.zeros((3, laser.n_beams))

    def take(self, scan: Scan, velocity: Pose2) -> None:
        """Read a scan; `velocity` of the base [m/s, rad/s] counts where a sweep is taken out."""
        laser = self.laser
        self.n = kernels.end_points(
            scan.ranges, laser.directions, laser.mount, self._limits, self.points
        )
        if self.sweeps:
            twist = Twist(velocity.x, velocity.y, velocity.theta, laser.time_increment)
            kernels.deskew(self.points, self.n, twist)
