"""ScanReader: a scan as points on walls, with its critical rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crsm.params import CrsmParams
from crsm.rays import critical_rays
from crsm.scan_kernels import Points, end_points, find_walls
from slams.types import IDENTITY, Floats, Laser, Pose2, Scan

LEAST_RANGE = 1e-3  # m
LEAST_POINTS = 10  # to match a scan
GOOD_LINE = 2.0  # range variances: no second look at one side only


class ScanReader:
    """Buffers for the scans of one laser and what was read last into them."""

    def __init__(self, params: CrsmParams, laser: Laser) -> None:
        self.params = params
        self.laser = laser
        self.points = _blank(laser.n_beams)
        self.m = 0
        self.reach = 0.0
        self._rays: NDArray[np.int64] | None = None
        self._ends: Floats | None = None
        self._beams = np.zeros((laser.n_beams, 4))
        self._move_beams(IDENTITY)
        noise2 = params.range_noise**2
        self._within = (max(laser.range_min, LEAST_RANGE), min(laser.range_max, params.max_range))
        self._gap = (params.gap, params.gap_beams * abs(laser.angle_increment))
        self._limits = (GOOD_LINE * noise2, params.roughness**2 * noise2)

    def read(self, scan: Scan, velocity: Pose2) -> None:
        """Points, walls and rays, freed from the motion during the scan (base, m/s and rad/s)."""
        if self.sweeps:
            self._move_beams(velocity)
        points = self.points
        self.m, self.reach = end_points(scan.ranges, self._beams, self._within, self._gap, points)
        at = self.laser.mount
        find_walls(points, self.m, self.params.window**2, self._limits, (at.x, at.y))
        self._rays = self._ends = None

    @property
    def rays(self) -> NDArray[np.int64]:
        """Numbers of the points that are critical rays, chosen when first asked for."""
        if self._rays is None:
            first = self.points.first[: self.m + 1]
            edges = np.diff(first) != 0  # the last before a jump ...
            edges[1:] |= edges[:-1]  # ... and the first behind it
            start = np.array([[self.laser.mount.x, self.laser.mount.y]])
            far = np.hypot(*(self.points.xy[: self.m] - start).T)
            count = self.params.critical_rays
            self._rays = critical_rays(*self._information(), far, edges, count)
        return self._rays

    @property
    def ends(self) -> Floats:
        """End points (k, 2) [m] of the critical rays, in the base frame."""
        if self._ends is None:
            self._ends = self.points.xy[self.rays]
        return self._ends

    @property
    def sweeps(self) -> bool:
        """The beams are measured one after the other."""
        return self.laser.time_increment > 0.0

    @property
    def is_usable(self) -> bool:
        """There is enough to see to be matched."""
        return self.m >= LEAST_POINTS

    def _move_beams(self, velocity: Pose2) -> None:
        """Directions and starts of the beams as seen from where the base was at the first one."""
        t = self.laser.time_increment * np.arange(self.laser.n_beams)
        heading = velocity.theta * t
        c, s = np.cos(heading), np.sin(heading)
        at, (x, y) = self.laser.mount, Pose2(0.0, 0.0, self.laser.mount.theta).transform(
            self.laser.directions
        ).T
        start = c * at.x - s * at.y + velocity.x * t, s * at.x + c * at.y + velocity.y * t
        self._beams[:] = np.stack((c * x - s * y, s * x + c * y, *start), axis=1)

    def _information(self) -> tuple[Floats, Floats]:
        """What each point measures: rows (3, 2m) over x, y, theta, weights (2m,) [1/m2].

        A wall point has one row, the second is 0; a lone point has two.
        """
        p, m = self.params, self.m
        xy, normal, spread = self.points.xy[:m].T, self.points.normal[:m].T, self.points.spread[:m]
        lone = (normal[0] == 0.0) & (normal[1] == 0.0)
        cx = np.concatenate((normal[0] + lone, np.zeros(spread.size)))
        cy = np.concatenate((normal[1], lone))
        turn = cy * np.tile(xy[0], 2) - cx * np.tile(xy[1], 2)
        variance = np.where(lone, p.lone_noise**2, p.range_noise**2 + spread)
        return np.stack((cx, cy, turn)), np.tile(1.0 / variance, 2)


def _blank(n: int) -> Points:
    """Room for the points of n beams."""
    return Points(
        np.zeros((n + 1, 2)),
        np.zeros((n, 2)),
        np.zeros(n),
        np.zeros(n + 1, np.int64),
        np.zeros((n + 1, 5)),
        np.zeros((n, 2), np.int64),
    )
