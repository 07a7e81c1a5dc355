"""ScanReader: the end points of the scan at hand, with its critical rays."""

from __future__ import annotations

import numpy as np

from crsm.params import CrsmParams
from crsm.rays_kernels import critical_rays
from slams.scan.end_points import EndPoints
from slams.types import Floats, Pose2, Scan

MIN_CRITICAL_RAYS = 60  # even where they are more than half of a scan's end points


class ScanReader(EndPoints):
    """End points of a scan, and those of its critical rays: `ends` (k, 2) [m] in the base frame."""

    def __init__(self, params: CrsmParams) -> None:
        super().__init__(params)
        self.ends: Floats = np.zeros((0, 2))
        self._count = params.critical_rays
        self._H = np.zeros((3, 3))

    def read(self, scan: Scan, velocity: Pose2) -> ScanReader:
        """Read a scan and choose its rays; `velocity` [m/s, rad/s] of the base is for deskewing."""
        super().read(scan, velocity)
        count = min(self._count, max(self.n // 2, MIN_CRITICAL_RAYS))
        ends, normals = np.empty((self.n, 2)), self.normals
        k = critical_rays(
            self.points, normals, self.moments, self.n, self.mount, count, self._H, ends
        )
        self.ends = ends[:k]
        return self

    def information(self, theta: float) -> Floats:
        """Information (3, 3) of the rays at heading `theta` [1/m^2, 1/(m rad), 1/rad^2]."""
        c, s = np.cos(theta), np.sin(theta)
        rotation = np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))
        share = len(self.ends) / max(self.n, 1)
        return np.asarray(rotation @ self._H @ rotation.T * (share / self.noise**2))
