"""ScanReader: the end points of the scan at hand, with its critical rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crsm.params import CrsmParams
from crsm.rays_kernels import critical_rays
from slams.scan.end_points import EndPoints
from slams.types import Floats, Pose2, Scan

LEAST_RAYS = 60  # otherwise at most half of the points: all of them have no choice in them


class ScanReader(EndPoints):
    """End points, and the few of them that hill climbing looks at.

    `rays` (k,) their numbers, `ends` (k, 2) [m] in the base frame, both chosen by `choose`.
    """

    def __init__(self, params: CrsmParams) -> None:
        super().__init__(params)
        self.rays: NDArray[np.int64] = np.zeros(0, np.int64)
        self.ends: Floats = np.zeros((0, 2))
        self._count = params.critical_rays
        self._H = np.zeros((3, 3))

    def take(self, scan: Scan, velocity: Pose2) -> ScanReader:
        """Read a scan and choose its rays; `velocity` of the base frees a sweep from its motion."""
        super().take(scan, velocity)
        count = min(self._count, max(self.n // 2, LEAST_RAYS))
        out, normals = np.empty(self.n, np.int64), self.normals
        k = critical_rays(
            self.points, normals, self.moments, self.n, self.mount, count, self._H, out
        )
        self.rays = out[:k]
        self.ends = np.ascontiguousarray(self.points[:2, self.rays].T)
        return self

    def information(self, theta: float) -> Floats:
        """What the rays say of a pose of heading `theta` (3, 3) [1/m^2, 1/(m rad), 1/rad^2]."""
        c, s = np.cos(theta), np.sin(theta)
        turned = np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))
        share = len(self.rays) / max(self.n, 1)
        return np.asarray(turned @ self._H @ turned.T * (share / self.noise**2))
