"""View: the present scan, prepared as in the program."""

from __future__ import annotations

import numpy as np

from slams.types import Laser, Scan
from tsd.original.params import OriginalParams
from tsd.original.scan_kernels import Sensor, mask_scan

ONE_BEAM_INCREMENT = 1e-6  # rad, angle increment of a laser with a single beam
MIN_SENSOR_RANGE = 0.001  # m, original code


class View:
    """Buffers for the scans of one laser; clockwise scans are reversed.

    `ranges` (n,) [m] and `mask` (n,) of `mask_scan`; `valid` (n,), whether a beam has a point;
    `scene` (n, 2) [m], the points in the laser's frame, 0 where not valid.
    """

    def __init__(self, params: OriginalParams, laser: Laser) -> None:
        n, angles = laser.n_beams, np.sort(laser.angles)
        self.laser = laser
        self.sensor = Sensor(
            float(angles[0]),
            abs(laser.angle_increment) or ONE_BEAM_INCREMENT,
            MIN_SENSOR_RANGE,
            params.longest,
            params.low_reflectivity,
            params.max_weight,
            params.weight_unit,
        )
        self.ranges, self.mask = np.zeros(n), np.zeros(n, np.bool_)
        self.valid = np.zeros(n, np.bool_)
        self.scene = np.zeros((n, 2))
        self._params = params
        self._directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)

    def read(self, scan: Scan) -> int:
        """Mask the scan and compute its points; returns their number."""
        p = self._params
        mask_scan(scan.ranges, self.sensor, p.shortest, p.jump_angle, self.ranges, self.mask)
        if self.laser.angle_increment < 0.0:  # reversed like the angles
            self.ranges[:], self.mask[:] = self.ranges[::-1].copy(), self.mask[::-1].copy()
        self.valid = self.mask & np.isfinite(self.ranges)
        self.scene[:] = np.where(self.valid, self.ranges, 0.0)[:, None] * self._directions
        return int(self.valid.sum())
