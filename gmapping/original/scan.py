"""EndPoints: the end points of a scan, with the program's angles or the true ones."""

from __future__ import annotations

import numpy as np

from gmapping.original.motion import Step
from gmapping.original.params import OriginalParams
from gmapping.original.scan_kernels import Beams, end_points
from slams.types import Floats, Laser, Scan


class EndPoints:
    """Turns ranges into points of the base frame; buffers are kept from scan to scan.

    `offset` is by how many beam widths the beams are turned.
    """

    def __init__(self, params: OriginalParams, offset: float) -> None:
        self._params = params
        self._offset = offset
        self._laser: Laser | None = None
        self._directions = np.zeros((0, 2))
        self._buffer = np.zeros((0, 2))

    def __call__(self, scan: Scan, step: Step) -> Floats:
        """Points (n, 2) x, y [m], valid until the next call."""
        if scan.laser is not self._laser:
            self._aim(scan.laser)
        beams = self._geometry(scan.laser, step)
        return self._buffer[: end_points(scan.ranges, self._directions, beams, self._buffer)]

    def _aim(self, laser: Laser) -> None:
        angles = laser.angles + self._offset * abs(laser.angle_increment)
        self._laser = laser
        self._directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        self._buffer = np.zeros((laser.n_beams, 2))

    def _geometry(self, laser: Laser, step: Step) -> Beams:
        sweeps = self._params.deskew and laser.time_increment > 0.0 and step.seconds > 0.0
        share = laser.time_increment / step.seconds if sweeps else 0.0
        x, y, turn = (share * value for value in step.pose)
        far = min(laser.range_max, self._params.max_range)
        return Beams(*laser.mount, x, y, turn, laser.range_min, far)
