"""ScanReader: the end points of the scan at hand, with its critical rays."""

from __future__ import annotations

import numpy as np

from crsm.params import CrsmParams
from crsm.rays_kernels import critical_rays
from slams.scan.end_points import EndPoints
from slams.types import Floats, Pose2, Scan

LEAST_RAYS = 60  # otherwise at most half of the points: all of them have no choice in them


class ScanReader(EndPoints):
    """End points, and the few of them that hill climbing looks at.

    `ends` (k, 2) [m] of these rays, in the base frame.
    """

    def __init__(self, params: CrsmParams) -> None:
        super().__init__(params)
        self.ends: Floats = np.zeros((0, 2))
        self._count = params.critical_rays
        self._H = np.zeros((3, 3))

    def read(self, scan: Scan, velocity: Pose2) -> ScanReader:
        """Read a scan and choose its rays; `velocity` of the base frees a sweep from its motion."""
        super().read(scan, velocity)
        count = min(self._count, max(self.n // 2, LEAST_RAYS))
        ends, normals = np.empty((self.n, 2)), self.normals
        k = critical_rays(
            self.points, normals, self.moments, self.n, self.mount, count, self._H, ends
        )
        self.ends = ends[:k]
        return self

    def information(self, theta: float) -> Floats:
        """What the rays say of a pose of heading `theta` (3, 3) [1/m^2, 1/(m rad), 1/rad^2]."""
        c, s = np.cos(theta), np.sin(theta)
        turned = np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))
        share = len(self.ends) / max(self.n, 1)
        return np.asarray(turned @ self._H @ turned.T * (share / self.noise**2))
