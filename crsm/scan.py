"""ScanReader: a scan as points on walls, with its critical rays."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from crsm.params import CrsmParams
from crsm.rays_kernels import critical_rays
from crsm.scan_kernels import Points, end_points, find_walls
from slams.types import IDENTITY, Floats, Laser, Pose2, Ranges, Scan

LEAST_RANGE = 1e-3  # m
LEAST_RAYS = 60  # otherwise at most half of the points: all of them have no choice in them
LEAST_POINTS = 10  # to match a scan
QUARTER = 0.3186 * math.sqrt(1.5)  # noises that a quarter of such distances is below
MOST_NOISE = 0.15  # m
MEMORY = 0.1  # weight of one scan in the noise
TORN = 4.0  # noises that neighbors on one wall may be further apart
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
        self._within = (max(laser.range_min, LEAST_RANGE), min(laser.range_max, params.max_range))
        self._gap = params.gap_beams * abs(laser.angle_increment)
        self.noise = 0.0  # m, as measured, 0 before

    def read(self, scan: Scan, velocity: Pose2) -> None:
        """Points, walls and rays, freed from the motion during the scan (base, m/s and rad/s)."""
        if self.sweeps:
            self._move_beams(velocity)
        self._measure_noise(scan.ranges)
        self._find_walls(scan)
        self._rays = self._ends = None

    def _find_walls(self, scan: Scan) -> None:
        p, at, points = self.params, self.laser.mount, self.points
        noise = max(self.noise, p.range_noise)
        more = noise / p.range_noise
        gap = (p.gap + TORN * (noise - p.range_noise), self._gap)
        self.m, self.reach = end_points(scan.ranges, self._beams, self._within, gap, points)
        limits = (GOOD_LINE * noise**2, (p.roughness * noise) ** 2)
        window = p.window * more ** (2.0 / 3.0)  # for normals that are no worse
        find_walls(points, self.m, window**2, limits, (at.x, at.y))

    def _measure_noise(self, ranges: Ranges) -> None:
        """How far ranges lie off the straight wall through the beams on both sides of them."""
        r = ranges[(ranges >= self._within[0]) & (ranges < self._within[1])].astype(np.float64)
        if len(r) < LEAST_POINTS:
            return
        straight = 2.0 * math.cos(self.laser.angle_increment) / (1.0 / r[:-2] + 1.0 / r[2:])
        off = np.abs(straight - r[1:-1])
        off = np.sort(off[off < self.params.gap + self._gap * r[1:-1]])
        if off.size:
            low, high = self.params.range_noise, MOST_NOISE
            measured = min(max(float(off[off.size // 4]) / QUARTER, low), high)
            self.noise += (MEMORY if self.noise else 1.0) * (measured - self.noise)

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
        at, (x, y) = (
            self.laser.mount,
            Pose2(0.0, 0.0, self.laser.mount.theta).transform(self.laser.directions).T,
        )
        start = c * at.x - s * at.y + velocity.x * t, s * at.x + c * at.y + velocity.y * t
        self._beams[:] = np.stack((c * x - s * y, s * x + c * y, *start), axis=1)

    def _chosen(self) -> NDArray[np.int64]:
        p, at = self.params, self.laser.mount
        noise, room = (p.range_noise**2, p.lone_noise**2), np.empty(self.m, np.int64)
        count = min(p.critical_rays, max(self.m // 2, LEAST_RAYS))
        k = critical_rays(self.points, self.m, (at.x, at.y), noise, count, room)
        return room[:k]


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
