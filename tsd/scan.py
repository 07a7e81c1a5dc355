"""SurfaceScan: one scan as surface elements with normals."""

from __future__ import annotations

import numpy as np

from slams.grid_bounds import Box
from slams.scan.end_points import ROBUST_SCALE_DEVIATIONS, EndPoints
from slams.types import Floats, Laser, Pose2, Scan
from tsd.map_kernels import place_lines
from tsd.params import TsdParams
from tsd.scan_kernels import Beams, SurfaceRule, find_runs, fit_surfaces

MAX_ISOLATED_GAP_CELLS = 10.0  # gap between beams up to which an isolated hit is a surface
LINE_SPACING_CELLS = 0.5  # between the lines of a push: every row of cells gets one of them


class SurfaceScan(EndPoints):
    """The last scan: its end points, and its surface elements, thinned for registration.

    `elements` (>= count, 8) of `fit_surfaces`; `beams`, the laser as an argument of kernels.

    Args:
        params: parameters.
    """

    def __init__(self, params: TsdParams) -> None:
        super().__init__(params)
        self._p = params
        self._rule = SurfaceRule(
            params.normal_window, 0.0, params.max_slope, 0.0, params.beam_width, 0.0, False
        )
        self.count = 0

    def read(self, scan: Scan, velocity: Pose2) -> SurfaceScan:
        """Read a scan and deskew it with the `velocity` of the base [m/s, rad/s]."""
        super().read(scan, velocity)
        self.beams = Beams(self.mount.x, self.mount.y, scan.laser.angle_increment)
        p = self._p
        rule = self._rule = SurfaceRule(
            self.resolution.window,
            self.noise,
            p.max_slope,
            (p.roughness * self.noise) ** 2,
            p.beam_width,
            MAX_ISOLATED_GAP_CELLS * p.cell,
            False,
        )
        find_runs(self.points, self.n, self.beams, rule, self._firsts)
        self.count = self._fit(rule, p.spacing, self.elements)
        return self

    def lines(self, pose: Pose2) -> tuple[Floats, Box]:
        """Lines (n, 7) of `place_lines` in the map for a push, and their bounding box."""
        rule = self._rule._replace(keep_isolated=True)
        count = self._fit(rule, LINE_SPACING_CELLS * self._p.cell, self._dense)
        lines = self._lines[:count]
        box = place_lines(self._dense, count, self._firsts, self.beams, np.array(pose), lines)
        return lines, Box(*box)

    @property
    def laser(self) -> Laser:
        """Laser of the last scan."""
        if self._laser is None:
            raise LookupError("no scan was read yet; call read() first")
        return self._laser

    @property
    def softness(self) -> float:
        """Robust scale: distance from a surface [m] at which an element has weight 1/2."""
        return max(self._p.robust, ROBUST_SCALE_DEVIATIONS * self.noise)

    def _adopt(self, laser: Laser) -> None:
        super()._adopt(laser)
        n = laser.n_beams
        self._firsts, self._lines = np.zeros(n + 1), np.zeros((n, 7))
        self.elements, self._dense = np.zeros((n, 8)), np.zeros((n, 8))

    def _fit(self, rule: SurfaceRule, spacing: float, out: Floats) -> int:
        sums = self.moments, self._firsts
        return int(fit_surfaces(self.points, self.n, *sums, self.beams, rule, spacing, out))
