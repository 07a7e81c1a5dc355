"""RangeNoise: the noise of one laser's ranges, measured over its last scans."""

from __future__ import annotations

import math

import numpy as np

from slams.scan.moving_average import MovingAverage
from slams.scan.noise_kernels import beyond_chords, noise_by_range
from slams.scan.params import ScanParams
from slams.scan.scan_kernels import Points
from slams.types import Pose2, Ranges, Scan

MAX_CHORD = 0.1  # m between two neighbors of a beam, or as far as beams are apart on a slanted wall
OUTLIER_DEVIATIONS = 3.0  # of the noise: a beam farther from its neighbors' line is off their wall
ROUNDING_UNIT = 1e-4  # m, of which rounded ranges are multiples; above the error of a float32
MIN_NOISE_SAMPLES = 10  # triples of beams that an estimate of the noise needs
TRUNCATED_MEDIAN = 0.6724  # median absolute normal deviate within `OUTLIER_DEVIATIONS`
CHORD_DISTANCE_STD = math.sqrt(1.5)  # of a beam minus the mean of two others, per beam's deviation
NOISE_MEAN_TIME = 1.0  # s: five scans of a slow laser; a robot moves by its length
GROWTH_TIME = 2.0  # s: whether the noise grows with the range is a property of the laser
MIN_GROWING_SHARE = 0.7  # of the variance at the typical range: far walls look rough to any laser


class RangeNoise:
    """Noise of a laser, constant or, as that of triangulation, proportional to the range.

    Args:
        params: limits of the noise, and its value before the first scan.
    """

    def __init__(self, params: ScanParams) -> None:
        self._params = params
        self._std = MovingAverage(NOISE_MEAN_TIME, params.range_noise)
        # rms range [m], variance of distances from chords there, and the part of it that grows:
        # 0 until many scans say otherwise
        self._typical, self._variance = MovingAverage(GROWTH_TIME), MovingAverage(GROWTH_TIME)
        self._growing = MovingAverage(GROWTH_TIME, prior=math.inf)
        self._step = 0.0  # m, that ranges are rounded to
        self._halves = np.zeros((2, 3))

    @property
    def std(self) -> float:
        """Standard deviation of a range [m], of the typical one if it is proportional."""
        return self._std.value

    @property
    def typical_range(self) -> float:
        """Range [m] at which the noise is `std`; 0 if the noise is the same at all ranges."""
        grows = self._growing.value > MIN_GROWING_SHARE * self._variance.value
        return self._typical.value if grows else 0.0

    def measure(
        self, scan: Scan, points: Points, n: int, mount: Pose2, step: float, scratch: Points
    ) -> None:
        """Add the noise of a scan, by the median distance of its end points from chords."""
        if self._std.is_fresh(scan.t):
            return
        if self._step == 0.0:
            self._step = rounding_step(scan.ranges)
        limit = max(OUTLIER_DEVIATIONS * self.std, 1.5 * self._step)
        limits, distances = (MAX_CHORD, limit), scratch[0]
        count = beyond_chords(points, n, mount, step, limits, distances)
        if count < MIN_NOISE_SAMPLES:
            return
        half = count // 2
        median = float(np.partition(distances[:count], half)[half])
        if median < 0.5 * self._step:  # most are rounded to 0: the median of grouped data
            median = 0.25 * self._step * count / int((distances[:count] < 0.5 * self._step).sum())
        else:
            typical, halves = self._typical.value, self._halves
            noise_by_range(points, n, mount, step, limits, typical, halves)
            self._measure_growth(scan.t, typical)
        noise, p = median / (TRUNCATED_MEDIAN * CHORD_DISTANCE_STD), self._params
        self._std.add(min(max(noise, p.quietest), p.noisiest), scan.t)

    def _measure_growth(self, t: float, typical: float) -> None:
        """Add how much of the variance grows as the square of the range.

        ours: from the variances of the nearer and of the farther beams on straight walls, as legs
        of people are near and smooth.
        """
        (n, near, near_square), (m, far, far_square) = self._halves.tolist()
        if n + m > 0.0:
            self._typical.add(math.sqrt((near_square + far_square) / (n + m)), t)
        if min(n, m) >= MIN_NOISE_SAMPLES:
            near, far = (near / n) ** 2, (far / m) ** 2
            slope = (far - near) / (far_square / m - near_square / n)
            growing = slope * typical**2
            self._growing.add(growing, t)
            self._variance.add(near + growing - slope * near_square / n, t)


def rounding_step(ranges: Ranges) -> float:
    """The step that all ranges (n,) [m] are rounded to [m]: their greatest common divisor.

    `ROUNDING_UNIT` if they are not rounded, 0 if they are too few.
    """
    gaps = np.diff(ranges[np.isfinite(ranges)].astype(np.float64))
    multiples = np.round(gaps / ROUNDING_UNIT).astype(np.int64)
    if np.count_nonzero(multiples) < MIN_NOISE_SAMPLES:
        return 0.0
    return ROUNDING_UNIT * max(int(np.gcd.reduce(multiples)), 1)
