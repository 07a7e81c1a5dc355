"""The published program of CRSM SLAM, crsm_slam of 2016, step by step.

[Tsardoulias13] E. Tsardoulias, L. Petrou: "Critical Rays Scan Match SLAM", Journal of Intelligent
& Robotic Systems 72, 2013. Bytes for a map, whole cells for a pose, 40 002 evaluations for every
scan, no odometry:

1. clean the ranges and choose the critical rays;
2. climb from the last pose, restarting at random; the best step of the lattice moves the pose;
3. during the first scans the pose stays at the start;
4. draw the scan into the global map.
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
    """crsm_slam; the pose is that of the laser, in cells from the start and a heading."""

    Params: ClassVar[type[Params]] = OriginalParams

    def __init__(self, params: OriginalParams) -> None:
        self.params = params
        self.score = 0.0
        self._counts = {"inserted": 0, "rejected": 0, "rays": 0, "odometry": 0}
        self._rng = np.random.default_rng(params.seed)
        self._scans = 0
        self._map = ByteMap(params)
        self._view: RayPicker | None = None
        self._memory: tuple[NDArray[np.float32], ...] = ()
        self._step = np.zeros(3)
        self._mount = IDENTITY
        self._x = self._y = 0
        self._theta = 0.0

    def update(self, scan: Scan) -> Pose2:
        """Take the next scan; return the base's pose in the map."""
        view = self._view_of(scan)
        view.look(scan.ranges)  # 1
        self._counts["rays"] += view.n_rays
        self._counts["rejected"] += view.n_rays == 0
        if view.n_rays > 0:
            self._hill_climb(view)  # 2
        if self._scans < self.params.hold:
            self._x, self._y, self._theta = 0, 0, float(np.float32(self._mount.theta))  # 3
        self._map.draw(view, self._x, self._y, self._theta)  # 4
        self._counts["inserted"] += 1
        self._scans += 1
        return self._laser_pose() @ scan.laser.mount.inverse()

    def map(self) -> OccupancyGrid:
        """The gray levels of the map as probabilities."""
        return self._map.occupancy(self._mount)

    def report(self) -> dict[str, Any]:
        """Counts of what happened so far."""
        return self._counts | self._map.extent.counts

    def _view_of(self, scan: Scan) -> RayPicker:
        """Buffers for the scan's laser; at the first scan the start."""
        if self._view is None:
            self._mount = scan.laser.mount
            self._theta = float(np.float32(self._mount.theta))
            self._map.draw_patch(self._mount)
            self._take(RayPicker(self.params, scan.laser))
        elif self._view.laser != scan.laser:
            self._take(RayPicker(self.params, scan.laser, self._view.level))
        assert self._view is not None
        return self._view

    def _take(self, view: RayPicker) -> None:
        """A new laser, and room for the search with its rays."""
        disparity, n = self.params.disparity, view.laser.n_beams
        side = 2 * (disparity // 4) + 1
        self._view = view
        # fitness per lattice pose, turned rays per heading, turned rays off the lattice
        self._memory = (
            np.zeros((disparity, side, side), np.float32),
            np.zeros((disparity, n, 2), np.float32),
            np.zeros((n, 2), np.float32),
        )

    def _hill_climb(self, view: RayPicker) -> None:
        """Random restart hill climbing; the best step moves the pose."""
        p, grid = self.params, self._map
        draws = self._rng.integers(0, p.disparity, (p.iterations + 2, 3), dtype=np.int16)
        start = (float(self._x), float(self._y), self._theta, *grid.origin.tolist())
        kernels.score_table(grid.cells, self._box(view), grid.scores)
        self.score = kernels.hill_climb(
            grid.scores, view.rays, view.n_rays, start, draws, p.disparity, self._memory, self._step
        )
        self._x += round(self._step[0])
        self._y += round(self._step[1])
        turned = float(np.float32(np.float32(self._theta) + np.float32(self._step[2])))
        self._theta = float(np.float32(math.remainder(turned, 2.0 * math.pi)))

    def _box(self, view: RayPicker) -> tuple[int, int, int, int]:
        """The part of the map that the search can see (x0, y0, x1, y1)."""
        rays = view.rays[: view.n_rays]
        far = int(np.hypot(rays[:, 0], rays[:, 1]).max()) + 2 * self.params.disparity
        x, y = self._x + int(self._map.origin[0]), self._y + int(self._map.origin[1])
        ny, nx = self._map.cells.shape
        return max(0, x - far), max(0, y - far), min(nx, x + far), min(ny, y + far)

    def _laser_pose(self) -> Pose2:
        cell, mount = self.params.cell, self._mount
        return Pose2(mount.x + self._x * cell, mount.y + self._y * cell, self._theta)
