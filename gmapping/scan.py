"""View: what of a scan the particles' maps are made of and matched with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gmapping.params import GMappingParams
from gmapping.scan_kernels import Walls, merged, surfaces
from slams.scan.end_points import EndPoints
from slams.types import Pose2, Scan

GRAZING = 0.1  # cosine; walls seen more edge-on say nothing
RATIO = 0.1  # thickness over length of a wall, squared
SOFT = 3.0  # deviations of the noise that a wall may be thick


class View(EndPoints):
    """The pieces of surface of the scan at hand; the buffers serve every scan.

    `pieces` (k, 5): x, y [m], nx, ny in the base frame at the middle of the sweep, how many beams;
    `beams` of all of them together.
    """

    params: GMappingParams

    def __init__(self, params: GMappingParams) -> None:
        super().__init__(params)
        self._means, self._buffer = np.zeros((0, 3)), np.zeros((0, 5))
        self.pieces, self.beams = self._buffer, 0.0

    def take(self, scan: Scan, velocity: Pose2) -> View:
        """Read a scan; `velocity` of the base [m/s, rad/s] takes out the motion of the sweep."""
        super().take(scan, velocity)
        p = self.params
        if self.n > len(self._buffer):
            self._means, self._buffer = np.zeros((self.n, 3)), np.zeros((self.n, 5))
        n = merged(self.points, self.n, p.grain, self._means)
        flatness = max(p.flatness, SOFT * self.noise)
        walls = Walls(max(p.reach, 2.0 * flatness), flatness, RATIO, GRAZING)
        n = surfaces(self._means, n, self.mount, self.step, walls, self._buffer)
        self.pieces = self._buffer[:n]
        self.beams = float(self.pieces[:, 4].sum())
        if self.beams == 0.0:
            self.n = 0
        return self

    @property
    def ends(self) -> NDArray[np.float32]:
        """A copy of the pieces' x, y [m] (k, 2), for the picture of the map."""
        return self.pieces[:, :2].astype(np.float32)
