"""View: what of a scan the particles' maps are made of and matched with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gmapping.params import GMappingParams
from gmapping.scan_kernels import pieces
from slams.scan.end_points import EndPoints
from slams.types import Floats, Pose2, Scan

SURFACE_ERROR = 0.005  # m: what the beams of one piece share, as walls are not straight


class View(EndPoints):
    """The pieces of surface of the scan at hand.

    `pieces` (k, 5): x, y [m], nx, ny in the base frame at the middle of the sweep, and the weight:
    as many independent beams; `beams` of all of them together.
    """

    params: GMappingParams
    rough_normal_error = 0.05  # rad: of normals over a window

    def __init__(self, params: GMappingParams) -> None:
        super().__init__(params)
        self.pieces, self.beams = np.zeros((0, 5)), 0.0

    def read(self, scan: Scan, velocity: Pose2) -> View:
        """Read a scan; `velocity` of the base [m/s, rad/s] takes out the motion of the sweep."""
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
        """Turn the beams (k,) of pieces into weights, inverse variances over that of one beam.

        ours: a leg near the laser has more beams than the far end of a corridor, and knows less.
        """
        beam, surface = self.noise**2, SURFACE_ERROR**2
        beams[:] = (beam + surface) / (beam / beams + surface)

    @property
    def ray(self) -> NDArray[np.float32]:
        """The pieces' x, y [m], and last where the laser is (k + 1, 2), for the map's picture."""
        return np.vstack([self.pieces[:, :2], self.mount[:2]]).astype(np.float32)
