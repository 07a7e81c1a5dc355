"""End points of a scan, for whichever matcher."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gmapping.motion import Step
from gmapping.params import GMappingParams
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
        self._directions = np.zeros((0, 2))
        self._buffer = np.zeros((0, 3))

    def __call__(self, scan: Scan, step: Step) -> tuple[Floats, Beams]:
        """Points (n, 3) x, y [m], beams, valid until the next call; the geometry behind them."""
        if scan.laser is not self._laser:
            self._aim(scan.laser)
        beams = self._geometry(scan.laser, step)
        n = end_points(scan.ranges, self._directions, beams, self._buffer)
        return self._buffer[:n], beams

    def _aim(self, laser: Laser) -> None:
        angles = laser.angles + self._params.beam_offset * abs(laser.angle_increment)
        self._laser = laser
        self._directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        self._buffer = np.zeros((laser.n_beams, 3))

    def _geometry(self, laser: Laser, step: Step) -> Beams:
        self.sweeps = self._params.deskew and laser.time_increment > 0.0 and step.seconds > 0.0
        share = laser.time_increment / step.seconds if self.sweeps else 0.0
        x, y, turn = (share * value for value in step.sweep)
        far = min(laser.range_max, self._params.max_range)
        between = abs(laser.angle_increment)
        return Beams(*laser.mount, x, y, turn, between, laser.range_min, far, self._grain)
