"""ScanReader: a scan as points on walls, with its critical rays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from crsm.params import CrsmParams
from crsm.scan_kernels import Points, find_walls
from slams.types import Floats, Laser, Pose2, Scan

LEAST_POINTS = 10  # to match a scan
CANDIDATES = 4  # points looked at for each critical ray
GOOD_LINE = 2.0  # range variances: no second look at one side only


class ScanReader:
    """Buffers for the scans of one laser and what was read last into them."""

    def __init__(self, params: CrsmParams, laser: Laser) -> None:
        n = laser.n_beams
        self.params = params
        self.laser = laser
        self.points = Points(
            np.zeros((n, 2)),
            np.zeros((n, 2)),
            np.zeros(n),
            np.zeros(n, np.int64),
            np.zeros((n + 1, 5)),
        )
        self._rays: NDArray[np.int64] | None = None
        self.m = 0
        self.reach = 0.0

    def read(self, scan: Scan, velocity: Pose2) -> None:
        """Points, walls and rays, freed from the motion during the scan (base, m/s and rad/s)."""
        p = self.params
        longest = min(self.laser.range_max, p.max_range)
        usable = (scan.ranges >= max(self.laser.range_min, 1e-3)) & (scan.ranges < longest)
        beams = np.flatnonzero(usable)
        self.m = beams.size
        self._rays = None
        if self.m == 0:
            return
        ranges = scan.ranges[beams].astype(np.float64)
        self.reach = float(ranges.max())
        xy = self.laser.directions[beams] * ranges[:, None]
        if self.laser.time_increment > 0.0:
            xy = self._unmoved(xy, beams * self.laser.time_increment, velocity)
        self.points.beam[: self.m] = beams
        self.points.xy[: self.m] = xy
        self._find_walls()

    @property
    def rays(self) -> NDArray[np.int64]:
        """Numbers of the points that are critical rays, chosen when first asked for."""
        if self._rays is None:
            count = self.params.critical_rays
            every = max(1, self.m // (CANDIDATES * count))
            self._rays = every * critical_rays(*self._information(every), count)
        return self._rays

    @property
    def sweeps(self) -> bool:
        """The beams are measured one after the other."""
        return self.laser.time_increment > 0.0

    @property
    def is_usable(self) -> bool:
        """There is enough to see to be matched."""
        return self.m >= LEAST_POINTS

    def _unmoved(self, xy: Floats, t: NDArray[Any], velocity: Pose2) -> Floats:
        """End points as seen from where the laser was at the first beam; t (m,) [s] since then."""
        vx, vy, turn = self._of_laser(velocity)
        c, s = np.cos(turn * t), np.sin(turn * t)
        columns = (c * xy[:, 0] - s * xy[:, 1] + vx * t, s * xy[:, 0] + c * xy[:, 1] + vy * t)
        return np.stack(columns, axis=1)

    def _of_laser(self, velocity: Pose2) -> tuple[float, float, float]:
        """Velocity of the laser, seen from the laser, of a base that moves with `velocity`."""
        mount = self.laser.mount
        lever = Pose2(
            velocity.x - velocity.theta * mount.y, velocity.y + velocity.theta * mount.x, 0.0
        )
        seen = Pose2(0.0, 0.0, -mount.theta) @ lever
        return seen.x, seen.y, velocity.theta

    def _find_walls(self) -> None:
        p = self.params
        moments = np.cumsum(_moments(self.points.xy[: self.m]), axis=0)
        self.points.sums[1 : self.m + 1] = moments
        noise2 = p.range_noise**2
        gap = (p.gap, p.gap_beams * abs(self.laser.angle_increment))
        limits = (GOOD_LINE * noise2, p.roughness**2 * noise2)
        find_walls(self.points, self.m, p.window, gap, limits)

    def _information(self, every: int) -> tuple[Floats, Floats]:
        """What every n-th point measures: rows (3, 2k) over x, y, theta, weights (2k,) [1/m2].

        A wall point has one row, the second is 0; a lone point has two.
        """
        p, m = self.params, self.m
        xy, normal = self.points.xy[:m:every].T, self.points.normal[:m:every].T
        spread = self.points.spread[:m:every]
        lone = (normal[0] == 0.0) & (normal[1] == 0.0)
        cx = np.concatenate((normal[0] + lone, np.zeros(spread.size)))
        cy = np.concatenate((normal[1], lone))
        turn = cy * np.tile(xy[0], 2) - cx * np.tile(xy[1], 2)
        variance = np.where(lone, p.lone_noise**2, p.range_noise**2 + spread)
        return np.stack((cx, cy, turn)), np.tile(1.0 / variance, 2)


def _moments(xy: Floats) -> Floats:
    """x, y, xx, yy, xy of each point (m, 5)."""
    x, y = xy[:, 0], xy[:, 1]
    return np.stack((x, y, x * x, y * y, x * y), axis=1)


def leverage(rows: Floats, weights: Floats) -> Floats:
    """Share (m,) of each point in fixing the pose, w c' H^-1 c; together they are 3."""
    weighted = weights * rows
    h = np.array([[np.dot(a, b) for b in rows] for a in weighted]) + 1e-6 * np.eye(3)
    inverse = np.linalg.inv(h)
    shares = np.zeros_like(weights)
    for i in range(3):
        shares += weighted[i] * sum(inverse[i, j] * rows[j] for j in range(3))
    return np.asarray(shares.reshape(2, -1).sum(axis=0))


def critical_rays(rows: Floats, weights: Floats, count: int) -> NDArray[np.int64]:
    """Numbers of about `count` points that carry the pose: [Tsardoulias13] in spirit, rule ours.

    Half of them are spread evenly over the scan, half go to those with the greatest share in x, y
    and theta; both by error diffusion along the scan, without a draw.
    """
    m = len(weights) // 2
    if m <= count:
        return np.arange(m)
    owed = 0.5 * count * (leverage(rows, weights) / 3.0 + 1.0 / m)
    steps = np.floor(np.cumsum(np.minimum(owed, 1.0)))
    return np.flatnonzero(np.diff(steps, prepend=0.0) > 0.0)
