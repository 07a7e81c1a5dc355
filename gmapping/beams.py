"""End points of a scan, for whichever matcher."""

from __future__ import annotations

import numpy as np

from gmapping.motion import Step
from gmapping.params import GMappingParams
from gmapping.scan_kernels import Beams, end_points
from slams.types import Floats, Laser, Scan


class EndPoints:
    """Turns ranges into points of the base frame; buffers are kept from scan to scan."""

    def __init__(self, params: GMappingParams) -> None:
        self._params = params
        self._laser: Laser | None = None
        self._directions = np.zeros((0, 2))
        self._buffer = np.zeros((0, 2))

    def __call__(self, scan: Scan, step: Step) -> tuple[Floats, Beams]:
        """Points (n, 2) [m], valid until the next call, and the geometry they come from."""
        if scan.laser is not self._laser:
            self._aim(scan.laser)
        beams = self._geometry(scan.laser, step)
        n = end_points(scan.ranges, self._directions, beams, self._buffer)
        return self._buffer[:n], beams

    def _aim(self, laser: Laser) -> None:
        angles = laser.angles + self._params.beam_offset * abs(laser.angle_increment)
        self._laser = laser
        self._directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        self._buffer = np.zeros((laser.n_beams, 2))

    def _geometry(self, laser: Laser, step: Step) -> Beams:
        turning = self._params.deskew and laser.time_increment > 0.0 and step.seconds > 0.0
        share = laser.time_increment / step.seconds if turning else 0.0
        x, y, turn = (share * value for value in step.pose)
        far = min(laser.range_max, self._params.max_range)
        return Beams(*laser.mount, x, y, turn, abs(laser.angle_increment), laser.range_min, far)
