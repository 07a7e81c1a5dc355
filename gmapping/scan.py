"""End points of a scan."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gmapping.params import GMappingParams
from gmapping.render import Ray
from gmapping.scan_kernels import Beams, end_points
from slams.types import Floats, Laser, Pose2, Scan


class Track(NamedTuple):
    """A scan that was tracked: pose, points in the base frame, velocity it was deskewed with."""

    pose: Pose2
    points: Floats
    velocity: Pose2


class EndPoints:
    """Turns ranges into points of the base frame; buffers are kept from scan to scan.

    Beams that end within `grain` [m] of each other become one point; `sweeps` if the beams of the
    last scan follow one another in time.
    """

    def __init__(self, params: GMappingParams, grain: float = 0.0) -> None:
        self._params = params
        self._grain = grain
        self.sweeps = False
        self._laser: Laser | None = None
        self._buffer = np.zeros((0, 3))

    def __call__(self, scan: Scan, velocity: Pose2) -> tuple[Floats, Beams]:
        """Points (n, 3) x, y [m], beams, valid until the next call; the geometry behind them.

        `velocity` of the base [m/s, rad/s], in its own frame, while the beams were measured.
        """
        if scan.laser is not self._laser:
            self._laser = scan.laser
            self._buffer = np.zeros((scan.laser.n_beams, 3))
        beams = self._geometry(scan.laser, velocity)
        n = end_points(scan.ranges, scan.laser.directions, beams, self._buffer)
        return self._buffer[:n], beams

    def ray(self, scan: Scan, velocity: Pose2) -> Ray:
        """For the picture of the map: the points and where the laser was."""
        points, beams = self(scan, velocity)
        return Ray(points, np.array([[beams.x, beams.y]]))

    def _geometry(self, laser: Laser, velocity: Pose2) -> Beams:
        self.sweeps = self._params.deskew and laser.time_increment > 0.0
        between = laser.time_increment if self.sweeps else 0.0
        x, y, turn = (between * value for value in velocity)
        far = min(laser.range_max, self._params.max_range)
        apart = abs(laser.angle_increment)
        return Beams(*laser.mount, x, y, turn, apart, laser.range_min, far, self._grain)
