"""The published program of CRSM SLAM, crsm_slam of 2016, step by step.

[Tsardoulias13] E. Tsardoulias, L. Petrou: "Critical Rays Scan Match SLAM", Journal of Intelligent
& Robotic Systems 72, 2013. The map has bytes, the pose whole cells; no odometry. Per scan:

1. Remove invalid ranges and choose the critical rays.
2. Climb from the last pose with random restarts, 40 002 evaluations; add the best step to the pose.
3. During the first scans the pose stays at the start.
4. Draw the scan into the global map.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from crsm.original import match_kernels as kernels
from crsm.original.map import ByteMap
from crsm.original.params import OriginalParams
from crsm.original.scan import RayPicker
from slams.params import Params
from slams.types import IDENTITY, OccupancyGrid, Pose2, Scan


class Original:
    """crsm_slam; the module lists the steps. The pose is that of the laser, in cells and rad."""

    Params: ClassVar[type[Params]] = OriginalParams

    def __init__(self, params: OriginalParams) -> None:
        self.params = params
        self.score = 0.0
        self._counts = {"inserted": 0, "rejected": 0, "rays": 0, "odometry": 0}
        self._rng = np.random.default_rng(params.seed)
        self._scans = 0
        self._map = ByteMap(params)
        self._rays: RayPicker | None = None
        self._buffers: tuple[NDArray[np.float32], ...] = ()
        self._step = np.zeros(3)
        self._mount = IDENTITY
        self._x = self._y = 0
        self._theta = 0.0

    def update(self, scan: Scan) -> Pose2:
        """Match the scan to the map and draw it; return T_map_base."""
        rays = self._rays_of(scan)
        rays.read(scan.ranges)  # 1.
        self._counts["rays"] += rays.n_rays
        self._counts["rejected"] += rays.n_rays == 0
        if rays.n_rays > 0:
            self._hill_climb(rays)  # 2.
        if self._scans < self.params.hold:
            self._x, self._y, self._theta = 0, 0, float(np.float32(self._mount.theta))  # 3.
        self._map.draw(rays, self._x, self._y, self._theta)  # 4.
        self._counts["inserted"] += 1
        self._scans += 1
        return self._laser_pose() @ scan.laser.mount.inverse()

    def map(self) -> OccupancyGrid:
        """The gray levels of the map as probabilities of occupied."""
        return self._map.occupancy(self._mount)

    def report(self) -> dict[str, Any]:
        """Numbers of scans inserted and without rays (rejected), of rays, and of the bounds."""
        return self._counts | self._map.bounds.counts

    def _rays_of(self, scan: Scan) -> RayPicker:
        """The ray picker for the scan's laser; at the first scan, the start is set, too."""
        if self._rays is None:
            self._mount = scan.laser.mount
            self._theta = float(np.float32(self._mount.theta))
            self._map.draw_footprint(self._mount)
            self._allocate(RayPicker(self.params, scan.laser))
        elif self._rays.laser != scan.laser:
            self._allocate(RayPicker(self.params, scan.laser, self._rays.level))
        assert self._rays is not None
        return self._rays

    def _allocate(self, rays: RayPicker) -> None:
        """Set the ray picker, and make the buffers of `hill_climb` for its laser."""
        disparity, n = self.params.disparity, rays.laser.n_beams
        side = (disparity - 1) // 2 + 1
        self._rays = rays
        self._buffers = (
            np.zeros((disparity, side, side), np.float32),
            np.zeros((disparity, n, 2), np.float32),
            np.zeros((n, 2), np.float32),
        )

    def _hill_climb(self, rays: RayPicker) -> None:
        """Random restart hill climbing; the best step is added to the pose."""
        p, grid = self.params, self._map
        draws = self._rng.integers(0, p.disparity, (p.iterations + 2, 3), dtype=np.int16)
        start = (float(self._x), float(self._y), self._theta, *grid.origin.tolist())
        kernels.score_table(grid.cells, self._box(rays), grid.scores)
        ends, n, buffers, step = rays.rays, rays.n_rays, self._buffers, self._step
        kernels.hill_climb(grid.scores, ends, n, start, draws, p.disparity, buffers, step)
        self._x += round(self._step[0])
        self._y += round(self._step[1])
        theta = float(np.float32(np.float32(self._theta) + np.float32(self._step[2])))
        self._theta = float(np.float32(math.remainder(theta, 2.0 * math.pi)))

    def _box(self, rays: RayPicker) -> tuple[int, int, int, int]:
        """The part of the map (x0, y0, x1, y1) [cells] that the rays of the search can reach."""
        ends = rays.rays[: rays.n_rays]
        far = int(np.hypot(ends[:, 0], ends[:, 1]).max()) + 2 * self.params.disparity
        x, y = self._x + int(self._map.origin[0]), self._y + int(self._map.origin[1])
        ny, nx = self._map.cells.shape
        return max(0, x - far), max(0, y - far), min(nx, x + far), min(ny, y + far)

    def _laser_pose(self) -> Pose2:
        cell, mount = self.params.cell, self._mount
        return Pose2(mount.x + self._x * cell, mount.y + self._y * cell, self._theta)
