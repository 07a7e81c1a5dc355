"""The published program of TSD SLAM, ohm_tsd_slam.

[May14] S. May, P. Koch, R. Koch, C. Merkl, C. Pfitzner, A. Nuechter: A Generalized 2D and 3D
Multi-Sensor Data Integration Approach based on Signed Distance Functions for Multi-Modal Robotic
Mapping, VMV 2014.
[Koch15] P. Koch, S. May, M. Schmidpeter, M. Kuehn, C. Pfitzner, C. Merkl, R. Koch, M. Fees,
J. Martin, A. Nuechter: Multi-Robot Localization and Mapping Based on Signed Distance Functions,
ICARSC 2015.

1. Mask the scan and compute its points. Odometry and the times of single beams are not used.
2. Register the scan from the last pose: ray cast of a model scan, RANSAC pre-registration, ICP.
3. Reject a step that is too long: the last pose is kept and nothing is pushed.
4. Push the scan into the grid if the robot has moved.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from slams.params import Params
from slams.types import IDENTITY, OccupancyGrid, Pose2, Scan
from tsd.original.map import TsdGrid
from tsd.original.params import OriginalParams
from tsd.original.registration import Registration
from tsd.original.scan import View


class Original:
    """ohm_tsd_slam; see the module for the steps."""

    Params: ClassVar[type[Params]] = OriginalParams

    def __init__(self, params: OriginalParams) -> None:
        self.params = params
        self._rng = np.random.default_rng(params.seed)
        self._grid = TsdGrid(
            params.cell, params.truncation, 2**params.map_size, params.grows, params.max_cells
        )
        self._view: View | None = None
        self._registration: Registration | None = None
        self._pose = self._pushed_at = IDENTITY
        self._lost = 0
        self._counts = dict.fromkeys(("pushed", "rejected", "recovered", "empty"), 0)

    def update(self, scan: Scan) -> Pose2:
        """Match the next scan; return T_map_base."""
        view, registration = self._buffers_for(scan)
        if view.read(scan) == 0:  # 1
            self._counts["empty"] += 1
        elif self._counts["pushed"] == 0:
            self._push(view)
        else:
            self._register(view, registration)
        return self._pose

    def map(self) -> OccupancyGrid:
        """The present map."""
        return self._grid.occupancy()

    def report(self) -> dict[str, Any]:
        """Counts of scans."""
        return {**self._counts, "lost": self._lost, "odometry": 0, **self._grid.extent.counts}

    def _buffers_for(self, scan: Scan) -> tuple[View, Registration]:
        """Buffers for the scan's laser."""
        if self._view is None or self._registration is None or self._view.laser != scan.laser:
            self._view = View(self.params, scan.laser)
            self._registration = Registration(self.params, self._rng, self._view)
        return self._view, self._registration

    def _register(self, view: View, registration: Registration) -> None:
        mount = view.laser.mount
        step = registration.register(self._grid.kernel, np.array(self._pose @ mount))  # 2
        if step is None:  # 3
            self._counts["rejected"] += 1
            self._lost += 1
            return
        self._counts["recovered"] += self._lost > 0
        self._lost = 0
        self._pose = self._pose @ (mount @ step @ mount.inverse())
        if self._moved():
            self._push(view)  # 4

    def _moved(self) -> bool:
        step = self._pushed_at.between(self._pose)
        far = math.hypot(step.x, step.y) > self.params.push_translation
        return far or abs(math.sin(step.theta)) > self.params.push_rotation

    def _push(self, view: View) -> None:
        mask, laser = view.mask, np.array(self._pose @ view.laser.mount)
        if self._counts["pushed"] == 0:
            p, half = self.params, 0.5 * self.params.footprint
            self._grid.clear(float(laser[0]) + p.footprint_offset, float(laser[1]), half)
        else:
            mask = mask | np.isinf(view.ranges)  # after the first scan nan counts as free space
        self._grid.push(laser, view.ranges, mask, view.sensor)
        self._counts["pushed"] += 1
        self._pushed_at = self._pose
