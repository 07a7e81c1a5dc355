"""EndPoints: the end points of a scan, with the program's angles or the true ones."""

from __future__ import annotations

import numpy as np

from gmapping.original.params import OriginalParams
from gmapping.original.scan_kernels import end_points
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

    def __call__(self, scan: Scan) -> Floats:
        """Points (n, 2) x, y [m], valid until the next call."""
        laser = scan.laser
        if laser is not self._laser:
            self._aim(laser)
        limits = laser.range_min, min(laser.range_max, self._params.max_range)
        out = self._buffer
        return out[: end_points(scan.ranges, self._directions, laser.mount, limits, out)]

    def _aim(self, laser: Laser) -> None:
        angles = laser.angles + self._offset * abs(laser.angle_increment)
        self._laser = laser
        self._directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        self._buffer = np.zeros((laser.n_beams, 2))
