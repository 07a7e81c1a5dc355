"""End points of a scan."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gmapping.motion import Step
from gmapping.params import GMappingParams
from gmapping.render import Ray
from gmapping.scan_kernels import Beams, end_points
from slams.types import Floats, Laser, Pose2, Scan


class Track(NamedTuple):
    """A scan that was tracked: the pose, its points in the base frame, the step as it was seen."""

    pose: Pose2
    points: Floats
    step: Step


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

    def __call__(self, scan: Scan, step: Step) -> tuple[Floats, Beams]:
        """Points (n, 3) x, y [m], beams, valid until the next call; the geometry behind them."""
        if scan.laser is not self._laser:
            self._laser = scan.laser
            self._buffer = np.zeros((scan.laser.n_beams, 3))
        beams = self._geometry(scan.laser, step)
        n = end_points(scan.ranges, scan.laser.directions, beams, self._buffer)
        return self._buffer[:n], beams

    def ray(self, scan: Scan, step: Step) -> Ray:
        """For the picture of the map: the points and where the laser was."""
        points, beams = self(scan, step)
        return Ray(points, np.array([[beams.x, beams.y]]))

    def _geometry(self, laser: Laser, step: Step) -> Beams:
        self.sweeps = self._params.deskew and laser.time_increment > 0.0 and step.seconds > 0.0
        share = laser.time_increment / step.seconds if self.sweeps else 0.0
        x, y, turn = (share * value for value in step.sweep)
        far = min(laser.range_max, self._params.max_range)
        between = abs(laser.angle_increment)
        return Beams(*laser.mount, x, y, turn, between, laser.range_min, far, self._grain)
