"""SurfaceScan: what one scan shows, as surface elements with normals."""

from __future__ import annotations

import numpy as np

from slams.grid_bounds import Box
from slams.scan.end_points import EndPoints
from slams.types import Floats, Laser, Pose2, Scan
from tsd.map_kernels import place_lines
from tsd.params import TsdParams
from tsd.scan_kernels import Beams, SurfaceRule, find_runs, fit_surfaces

SPARSE = 10.0  # cells between beams, beyond which a hit alone is no surface
LINES = 0.5  # cells from line to line of a push: each row of cells takes one of them
SOFT = 3.0  # deviations of the noise at which an element counts half


class SurfaceScan(EndPoints):
    """The last scan: its end points, and its surface elements, thinned for registration.

    `elements` (>= count, 8) of `fit_surfaces`, `beams` as the kernels see them.

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
        """Read a scan; `velocity` of the base [m/s, rad/s] takes out the motion of the sweep."""
        super().read(scan, velocity)
        self.beams = Beams(self.mount.x, self.mount.y, scan.laser.angle_increment)
        p = self._p
        rule = self._rule = SurfaceRule(
            self.resolution.window,
            self.noise,
            p.max_slope,
            (p.roughness * self.noise) ** 2,
            p.beam_width,
            SPARSE * p.cell,
            False,
        )
        find_runs(self.points, self.n, self.beams, rule, self._firsts)
        self.count = self._fit(rule, p.spacing, self.elements)
        return self

    def lines(self, pose: Pose2) -> tuple[Floats, Box]:
        """Lines (n, 7) in the map, for a push, with the box around them."""
        rule = self._rule._replace(keeps_alone=True)
        count = self._fit(rule, LINES * self._p.cell, self._dense)
        lines = self._lines[:count]
        box = place_lines(self._dense, count, self._firsts, self.beams, np.array(pose), lines)
        return lines, Box(*box)

    @property
    def laser(self) -> Laser:
        """Of the last scan."""
        if self._laser is None:
            raise LookupError("no scan was taken yet; call take() first")
        return self._laser

    @property
    def softness(self) -> float:
        """Distance from a surface [m] at which an element counts half."""
        return max(self._p.robust, SOFT * self.noise)

    def _adopt(self, laser: Laser, n_beams: int) -> None:
        super()._adopt(laser, n_beams)
        n = n_beams
        self._firsts, self._lines = np.zeros(n + 1), np.zeros((n, 7))
        self.elements, self._dense = np.zeros((n, 8)), np.zeros((n, 8))

    def _fit(self, rule: SurfaceRule, spacing: float, out: Floats) -> int:
        room = self.moments, self._firsts
        return int(fit_surfaces(self.points, self.n, *room, self.beams, rule, spacing, out))
