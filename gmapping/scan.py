"""View: the scan as the particles' maps use it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gmapping.params import GMappingParams
from gmapping.scan_kernels import pieces
from slams.scan.end_points import EndPoints
from slams.types import Floats, Pose2, Scan

WALL_ROUGHNESS_STD = 0.005  # m: error that all beams of a piece share, as walls are not flat


class View(EndPoints):
    """End points of the current scan, and the pieces of surface that they form.

    `pieces` (k, 5): x, y [m], nx, ny in the base frame at the middle of the sweep, and the weight
    as a number of independent beams; `beams` is the sum of the weights.
    """

    params: GMappingParams
    rough_normal_error = 0.05  # rad: of normals that are fitted over a window

    def __init__(self, params: GMappingParams) -> None:
        super().__init__(params)
        self.pieces, self.beams = np.zeros((0, 5)), 0.0

    def read(self, scan: Scan, velocity: Pose2) -> View:
        """Read a scan and deskew it by the `velocity` of the base [m/s, rad/s]."""
        super().read(scan, velocity)
        out, grain = np.zeros((self.n, 5)), self.params.grain
        n = pieces(self.points, self.normals, self.n, self.mount, grain, out)
        self.pieces = out[:n]
        self._weigh(self.pieces[:, 4])
        self.beams = float(self.pieces[:, 4].sum())
        if n == 0:
            self.n = 0
        return self

    def _weigh(self, beams: Floats) -> None:
        """Turn the beam counts (k,) of pieces into weights: inverse variances, of one beam 1.

        ours: a leg near the laser has many beams, which share the error of its surface.
        """
        beam, surface = self.noise**2, WALL_ROUGHNESS_STD**2
        beams[:] = (beam + surface) / (beam / beams + surface)

    @property
    def ray(self) -> NDArray[np.float32]:
        """A keyframe for `Renderer`: the pieces' x, y [m], then the laser's (k + 1, 2)."""
        return np.vstack([self.pieces[:, :2], self.mount[:2]]).astype(np.float32)
