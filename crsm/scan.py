"""ScanReader: the end points of the scan at hand, with its critical rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crsm.params import CrsmParams
from crsm.rays_kernels import critical_rays
from crsm.sparse_kernels import sparse_normals
from slams.scan.end_points import EndPoints
from slams.scan.scan_kernels import Points
from slams.types import Floats, Pose2, Scan

LEAST_RAYS = 60  # otherwise at most half of the points: all of them have no choice in them
LEAST_POINTS = 10  # to match a scan


class ScanReader(EndPoints):
    """End points, and the few of them that hill climbing looks at."""

    def __init__(self, params: CrsmParams) -> None:
        super().__init__(params)
        self._params = params
        self._rays: NDArray[np.int64] | None = None
        self._ends: Floats | None = None

    def take(self, scan: Scan, velocity: Pose2) -> ScanReader:
        """Read a scan; `velocity` of the base [m/s, rad/s] takes out the motion of the sweep."""
        super().take(scan, velocity)
        self._rays = self._ends = None
        return self

    @property
    def normals(self) -> Points:
        """Of every end point the normal and the gap to its neighbors (3, >= n)."""
        known, found = self._known, super().normals
        if not known and self.is_sparse:
            sparse_normals(self.points, self.n, self.mount, self.step, self.noise, found)
        return found

    @property
    def rays(self) -> NDArray[np.int64]:
        """Numbers of the points that are critical rays, chosen when first asked for."""
        if self._rays is None:
            self._rays = self._chosen()
        return self._rays

    @property
    def ends(self) -> Floats:
        """End points (k, 2) [m] of the critical rays, in the base frame."""
        if self._ends is None:
            self._ends = np.ascontiguousarray(self.points[:2, self.rays].T)
        return self._ends

    @property
    def variances(self) -> tuple[float, float]:
        """Of a range and of a lone point [m^2]."""
        return self.noise**2, self._params.lone_noise**2

    @property
    def is_usable(self) -> bool:
        """There is enough to see to be matched."""
        return self.n >= LEAST_POINTS

    def _chosen(self) -> NDArray[np.int64]:
        p, room = self._params, np.empty(self.n, np.int64)
        count = min(p.critical_rays, max(self.n // 2, LEAST_RAYS))
        normals, at = self.normals, self.mount
        k = critical_rays(
            self.points, normals, self.moments, self.n, at, self.variances, count, room
        )
        return room[:k]
