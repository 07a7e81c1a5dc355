"""The published program of 2016, step by step, behind `crsm@original`."""

from __future__ import annotations

import math

import numpy as np

from crsm import published_kernels as kernels
from crsm.params import CrsmParams
from slams.types import IDENTITY, Laser, OccupancyGrid, Pose2, Ranges, Scan

LEAST_RANGE = 0.1  # m
EDGE = 0.05  # m below range_max: no ray is taken as a jump
FAR = 0.5  # m below range_max: a stretch of wall is not searched for more rays
GAP = 25  # rays
FIRST_LEVEL = 100.0  # of the ray picker
DEAD_BAND = (0.75, 1.25)  # of the desired number of rays
INTENSITY = (0.04, 0.2)
BOLD_SCANS = 10  # drawn with full intensity
PATCH_VALUE = 200


class PublishedScan:
    """Buffers for the rays of one laser."""

    def __init__(self, laser: Laser, disparity: int) -> None:
        n, side = laser.n_beams, 2 * (disparity // 4) + 1
        self.laser = laser
        self.d = np.zeros(n)
        self.ends = np.zeros((n, 2), np.int64)
        self.picked = np.zeros(n, np.bool_)
        self.rays = np.zeros((n, 2), np.float32)
        # fitness per lattice pose, turned rays per heading, turned rays off the lattice
        self.memory = (
            np.zeros((disparity, side, side), np.float32),
            np.zeros((disparity, n, 2), np.float32),
            np.zeros((n, 2), np.float32),
        )

    def clean(self, ranges: Ranges, cell: float) -> None:
        """Ranges and end cells; 0 is no data."""
        limits = (LEAST_RANGE, self.laser.range_max, cell)
        kernels.clean(ranges, self.laser.directions, limits, self.d, self.ends)


class Published:
    """Bytes for a map, whole cells for a pose, 40 002 evaluations for every scan."""

    def __init__(self, params: CrsmParams) -> None:
        self.params = params
        self.n_rays = 0
        self.score = 0.0
        self.counts = {"inserted": 0, "rejected": 0, "rays": 0, "odometry": 0}
        self._rng = np.random.default_rng(params.seed)
        self._level = FIRST_LEVEL
        self._scans = 0
        self._grid = np.full((params.side, params.side), kernels.UNKNOWN, np.uint8)
        self._table = np.zeros_like(self._grid, np.int16)
        self._origin = np.array([params.side // 2, params.side // 2])
        self._tables = np.zeros((3, 256), np.int64)
        self._grow = np.zeros(4, np.int64)
        self._step = np.zeros(3)
        self._view: PublishedScan | None = None
        self._mount = IDENTITY
        self._x = self._y = 0
        self._theta = 0.0

    def update(self, scan: Scan) -> Pose2:
        """Steps 1 to 7 of the program's scan callback; returns the base's pose."""
        view = self._look(scan)
        view.clean(scan.ranges, self.params.cell)
        density = self._critical_rays(view)
        if self.n_rays > 0:
            self._hill_climb(view)
        if self._scans < self.params.hold:
            self._x, self._y, self._theta = 0, 0, float(np.float32(self._mount.theta))
        self._draw(view, INTENSITY[1] if self._scans < BOLD_SCANS else density)
        self._scans += 1
        return self._laser_pose() @ scan.laser.mount.inverse()

    def grid(self) -> OccupancyGrid:
        """The bytes as probabilities; 127 is unknown."""
        p = (1.0 - self._grid / 255.0).astype(np.float32)
        p[self._grid == kernels.UNKNOWN] = np.nan
        cell, mount = self.params.cell, self._mount
        corner = (mount.x - self._origin[0] * cell, mount.y - self._origin[1] * cell)
        return OccupancyGrid(p, cell, (float(corner[0]), float(corner[1])))

    def _look(self, scan: Scan) -> PublishedScan:
        if self._view is None:
            self._mount = scan.laser.mount
            self._theta = float(np.float32(self._mount.theta))
            self._draw_patch()
        if self._view is None or self._view.laser != scan.laser:
            self._view = PublishedScan(scan.laser, self.params.disparity)
        return self._view

    def _critical_rays(self, view: PublishedScan) -> float:
        """Select rays and steer their number; returns the mean range difference."""
        p, range_max = self.params, view.laser.range_max
        density, longest = kernels.range_changes(view.d, p.jump, range_max - EDGE, view.picked)
        if longest > 0.0:
            far = range_max - FAR
            count = kernels.picked_between(view.d, self._level, far, longest, view.picked)
            self._steer(count)
        kernels.fill_gaps(GAP, view.picked)
        self.n_rays = kernels.selected(view.d, range_max, view.picked, view.ends, view.rays)
        self.counts["rays"] += self.n_rays
        self.counts["rejected"] += self.n_rays == 0
        return float(density)

    def _steer(self, count: int) -> None:
        """Integral controller with a dead band around the desired number of rays."""
        excess = count - self.params.picked_rays
        low, high = (self.params.picked_rays * share for share in DEAD_BAND)
        if count > high or count < low:
            self._level += excess

    def _hill_climb(self, view: PublishedScan) -> None:
        """Random restart hill climbing; the best step moves the pose."""
        p = self.params
        draws = self._rng.integers(0, p.disparity, (p.iterations + 2, 3), dtype=np.int16)
        start = (float(self._x), float(self._y), self._theta, *self._origin.tolist())
        kernels.score_table(self._grid, self._box(view), self._table)
        self.score = kernels.hill_climb(
            self._table,
            view.rays,
            self.n_rays,
            start,
            draws,
            p.disparity,
            view.memory,
            self._step,
        )
        self._x += round(self._step[0])
        self._y += round(self._step[1])
        turned = float(np.float32(np.float32(self._theta) + np.float32(self._step[2])))
        self._theta = float(np.float32(math.remainder(turned, 2.0 * math.pi)))

    def _box(self, view: PublishedScan) -> tuple[int, int, int, int]:
        """The part of the map that the search can see (x0, y0, x1, y1)."""
        rays = view.rays[: self.n_rays]
        far = int(np.hypot(rays[:, 0], rays[:, 1]).max()) + 2 * self.params.disparity
        x, y = self._x + int(self._origin[0]), self._y + int(self._origin[1])
        ny, nx = self._grid.shape
        return max(0, x - far), max(0, y - far), min(nx, x + far), min(ny, y + far)

    def _draw(self, view: PublishedScan, density: float) -> None:
        """Grow the map where the scan needs it, then draw every beam."""
        p = self.params
        heading = Pose2(0.0, 0.0, self._theta)
        directions = heading.transform(view.laser.directions)
        at = (float(self._x + self._origin[0]), float(self._y + self._origin[1]))
        kernels.reach(view.d, directions, at, self._grid.shape, p.cell, self._grow)
        if self._grow.any():
            self._enlarge()
            at = (float(self._x + self._origin[0]), float(self._y + self._origin[1]))
        gain = min(max(density, INTENSITY[0]), INTENSITY[1]) * p.density
        kernels.intensity_tables((gain, gain * p.obstacle_density), self._tables)
        increment = view.laser.angle_increment
        kernels.draw(view.d, view.ends, directions, increment, at, p.cell, self._tables, self._grid)
        self.counts["inserted"] += 1

    def _enlarge(self) -> None:
        left, right, low, high = self._grow.tolist()
        self._grid = np.pad(
            self._grid, ((low, high), (left, right)), constant_values=kernels.UNKNOWN
        )
        self._table = np.zeros_like(self._grid, np.int16)
        self._origin += (left, low)

    def _draw_patch(self) -> None:
        """The robot's own footprint is free."""
        p = self.params
        half_w, half_l = int(p.robot_width / p.cell / 2), int(p.robot_length / p.cell / 2)
        back = int(self._mount.x / p.cell)
        x, y = int(self._origin[0]) - back, int(self._origin[1])
        self._grid[y - half_w : y + half_w, x - half_l : x + half_l] = PATCH_VALUE

    def _laser_pose(self) -> Pose2:
        cell, mount = self.params.cell, self._mount
        return Pose2(mount.x + self._x * cell, mount.y + self._y * cell, self._theta)
