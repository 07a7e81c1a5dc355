"""View: what one scan shows, as surface elements with normals."""

from __future__ import annotations

import math

import numpy as np

from slams.extent import Box
from slams.types import Floats, Laser, Pose2, Scan
from tsd.map_kernels import place_lines
from tsd.params import TsdParams
from tsd.scan_kernels import (
    Beams,
    SurfaceRule,
    Twist,
    drop_specks,
    find_hits,
    find_runs,
    fit_surfaces,
    off_neighbors,
    sum_moments,
)

QUARTILE = 0.319  # of the size of a normal deviate
FROM_THREE = math.sqrt(1.5)  # deviation of a range from the mean of its neighbors, in deviations
SPARSE = 10.0  # cells between beams, beyond which a hit alone is no surface
RATE = 0.2  # 1/s, of the noise, by which a scan moves it: its median over scans is what is learned
FEW = 20  # triples of hits that tell no noise
CLUTTER = 2.0  # times the declared noise, which rough surfaces alone can look like
LEAST, MOST = 1e-4, 0.2  # m; a perfect laser, and one of no use


class View:
    """The last scan: its hits, and its surface elements, thinned for registration.

    Args:
        params: parameters.
    """

    def __init__(self, params: TsdParams) -> None:
        p = self._params = params
        self.noise = p.range_noise
        self._level, self._t = 0.0, 0.0  # of the noise, over the scans so far; s, the last of them
        self._rule = SurfaceRule(p.window, 0.0, p.max_slope, 0.0, p.beam_width, SPARSE * p.cell)
        self._laser: Laser | None = None
        self.count = 0

    def see(self, scan: Scan, twist: Pose2) -> int:
        """Hits and elements of a scan, deskewed by a velocity; returns how many elements."""
        if scan.laser is not self._laser and scan.laser != self._laser:
            self._take(scan.laser)
        found = find_hits(scan.ranges, self.beams, Twist(*twist), self._hits)
        self._n_hits = drop_specks(self._hits, found, self.beams, self._rule)
        rule = self._measured(scan.t)
        find_runs(self._hits, self._n_hits, self.beams, rule, self._runs)
        sum_moments(self._hits, self._n_hits, self._sums)
        self.count = self._fit(self._params.spacing, self.elements)
        return self.count

    def lines(self, pose: Pose2) -> tuple[Floats, Box]:
        """Every hit's line (n, 7) in the map, for a push, with the box around them."""
        count = self._fit(0.0, self._dense)
        lines = self._lines[:count]
        box = place_lines(self._dense, count, self._runs, self.beams, np.array(pose), lines)
        return lines, Box(*box)

    @property
    def laser(self) -> Laser:
        """Of the last scan."""
        if self._laser is None:
            raise LookupError("no scan was seen yet; call see() first")
        return self._laser

    def _measured(self, t: float) -> SurfaceRule:
        """What counts as a surface, at the noise of the hits at time `t` [s]."""
        p, n = self._params, off_neighbors(self._hits, self._n_hits, self.beams, self._off)
        if n >= FEW:
            quartile = float(np.partition(self._off[:n], n // 4)[n // 4])
            self._level = self._middle(quartile / (QUARTILE * FROM_THREE), t)
        self.noise = self._level if self._level > CLUTTER * p.range_noise else p.range_noise
        rough = (p.roughness * self.noise) ** 2
        window = p.window * math.sqrt(self.noise / p.range_noise)
        self._rule = self._rule._replace(window=window, noise=self.noise, rough=rough)
        return self._rule

    def _middle(self, seen: float, t: float) -> float:
        """The median of what scans show of the noise; where nothing was learned, the first."""
        dt, self._t = max(t - self._t, 0.0), t
        if self._level == 0.0:
            return min(max(seen, LEAST), MOST)
        step = math.exp(RATE * min(dt, 1.0))
        level = self._level * (step if seen > self._level else 1.0 / step)
        return min(max(level, LEAST), MOST)

    def _take(self, laser: Laser) -> None:
        """Memory and constants for a new scanner."""
        c, s = math.cos(laser.mount.theta), math.sin(laser.mount.theta)
        directions = np.ascontiguousarray(laser.directions @ np.array([[c, s], [-s, c]]))
        n = laser.n_beams
        self._laser = laser
        self.beams = Beams(
            directions,
            *laser.mount,
            laser.angle_increment,
            laser.range_min,
            laser.range_max,
            laser.time_increment,
        )
        self._hits, self._runs, self._off = np.zeros((n, 4)), np.zeros((n, 2)), np.zeros(n)
        self._sums = np.zeros((n + 1, 5))
        self.elements, self._dense = np.zeros((n, 6)), np.zeros((n, 6))
        self._lines = np.zeros((n, 7))

    def _fit(self, spacing: float, out: Floats) -> int:
        return int(
            fit_surfaces(
                self._hits,
                self._n_hits,
                self._runs,
                self._sums,
                self.beams,
                self._rule,
                spacing,
                out,
            )
        )
