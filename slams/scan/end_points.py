"""EndPoints: the end points of a scan, with normals and the noise of the ranges."""

from __future__ import annotations

import math

import numpy as np

from slams.geometry import constant_twist_step
from slams.params import MAX_LASERS
from slams.scan import scan_kernels as kernels
from slams.scan.leveling import Leveling
from slams.scan.moving_average import MovingAverage
from slams.scan.params import ScanParams
from slams.scan.range_noise import RangeNoise
from slams.scan.scan_kernels import Points, ScanResolution
from slams.types import IDENTITY, Laser, Pose2, Scan

MIN_GAP_THRESHOLD = 0.1  # m between neighbors of one surface
GAP_DEVIATIONS = 6.0  # of the noise between two neighbors of one surface
WINDOW_DEVIATIONS = 6.0  # of the noise in half a window: normals are good to 0.1 rad
MAX_COUNTED_INTERVAL, INTERVAL_MEAN_TIME = 1.0, 30.0  # s between two scans; s, of the mean of it
ROBUST_SCALE_DEVIATIONS = 3.0  # of the noise, at which the weight of a beam is halved


class EndPoints:
    """End points of a scan, leveled and deskewed to the middle of its sweep, in the base frame.

    An error of the velocity moves both halves of the sweep in opposite directions, so that it
    hardly moves the middle. `at_stamp` gives the pose at the scan's stamp, that of the first beam.

    `points` (4, >= n): x, y [m], number and weight of the beam; `radius` [m] the farthest from the
    base; `resolution`: noise of the ranges, and lengths that follow from it. All scans share the
    buffers.
    """

    rough_normal_error = 0.14  # rad, deviation of `rough_normals`, each of a chord of a few beams

    def __init__(self, params: ScanParams) -> None:
        self.params = params
        self.n = 0
        self.radius = 0.0
        self._noise = RangeNoise(params)
        self._noises: dict[Pose2, RangeNoise] = {}  # of each laser, by its mount
        self._interval, self._t = MovingAverage(INTERVAL_MEAN_TIME), math.inf
        self._has_moments = self._has_normals = self._has_chords = False
        self.resolution = ScanResolution(self.noise, params.normal_window, MIN_GAP_THRESHOLD)
        self.mount = IDENTITY
        self.step = 0.0
        self.has_sweep = False
        self._velocity = IDENTITY
        self._leveling = Leveling()
        self._laser: Laser | None = None
        self._size(1)

    def read(self, scan: Scan, velocity: Pose2) -> EndPoints:
        """Read a scan and deskew it by the `velocity` of the base [m/s, rad/s]."""
        laser = scan.laser
        if laser is not self._laser:
            self._adopt(laser)
        self._has_moments = self._has_normals = self._has_chords = False
        self.n, self.radius = kernels.end_points(
            scan.ranges[: laser.n_beams],
            self._directions,
            laser.mount,
            self._limits,
            self._noise.typical_range,
            self.points,
        )
        self.mount = laser.mount
        leveled = self._leveling.project(scan, velocity, self.points, self.n, self._scratch)
        if leveled is not None:
            self.n, self.radius, self.mount = leveled
        beams = self.points, self.n, self.mount, self.step
        self._noise.measure(scan, *beams, self._scratch)
        self._measure_interval(scan.t)
        window = max(self.params.normal_window, WINDOW_DEVIATIONS * self.noise)
        gap = max(MIN_GAP_THRESHOLD, GAP_DEVIATIONS * self.noise)
        self.resolution = ScanResolution(self.noise, window, gap)
        self.n = kernels.remove_isolated(*beams, gap, self._scratch)
        if self.has_sweep:
            self._velocity = velocity
            middle = 0.5 * (laser.n_beams - 1)
            kernels.deskew(self.points, self.n, velocity, laser.time_increment, middle)
        return self

    def at_stamp(self, pose: Pose2) -> Pose2:
        """Pose of the base at the stamp of the scan, whose middle was matched at `pose`."""
        if not self.has_sweep or self._laser is None:
            return pose
        return pose @ constant_twist_step(self._velocity, -0.5 * self._laser.sweep_time)

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of scans: leveled, and with each fault of an attitude (`Leveling`)."""
        return self._leveling.counts

    @property
    def noise(self) -> float:
        """Standard deviation of the ranges [m], measured over the last scans."""
        return self._noise.std

    @property
    def scan_interval(self) -> float:
        """Mean time between scans [s], each counted as 1 s at most; 0 before the second scan."""
        return self._interval.value

    @property
    def moments(self) -> Points:
        """Running sums along the scan and starts of its surfaces (6, n + 1): `scan_moments`."""
        if not self._has_moments:
            gap = self.resolution.gap_threshold
            kernels.scan_moments(self.points, self.n, self.mount, self.step, gap, self._moments)
            self._has_moments = True
        return self._moments

    @property
    def normals(self) -> Points:
        """Normal at every end point, and the gap [m] to its neighbors (3, >= n)."""
        if not self._has_normals:
            scan = self.points, self.n, self.mount, self.step
            kernels.scan_normals(*scan, self.resolution, self.moments, self._scratch)
            self._has_normals = True
        return self._scratch

    @property
    def rough_normals(self) -> Points:
        """Approximate normal at every end point, and the gap [m] to its neighbors (3, >= n).

        The normals if they were computed, else vectors across chords: enough to separate the two
        faces of a wall.
        """
        if self._has_normals:
            return self._scratch
        if not self._has_chords:
            kernels.chords(
                self.points, self.n, self.mount, self.step, self.resolution, self._chords
            )
            self._has_chords = True
        return self._chords

    def _measure_interval(self, t: float) -> None:
        """Add the time since the last scan, unless the stamp does not rise."""
        if t > self._t:
            self._interval.add(min(t - self._t, MAX_COUNTED_INTERVAL), t)
        self._t = t

    def _adopt(self, laser: Laser) -> None:
        self._laser, self.step, n_beams = laser, abs(laser.angle_increment), laser.n_beams
        if laser.mount not in self._noises:
            if len(self._noises) == MAX_LASERS:
                self._noises.clear()
            self._noises[laser.mount] = RangeNoise(self.params)
        self._noise = self._noises[laser.mount]
        self._directions = laser.directions
        self.has_sweep = self.params.deskew and laser.time_increment > 0.0
        self._limits = max(self.params.min_range, laser.range_min), self.params.max_range
        if n_beams > self.points.shape[1]:
            self._size(n_beams)

    def _size(self, n_beams: int) -> None:
        self.points = np.zeros((4, n_beams))
        self._scratch = np.zeros((4, n_beams))
        self._chords = np.zeros((3, n_beams))
        self._moments = np.zeros((6, n_beams + 1))


def pose_distance(points: EndPoints, one: Pose2, other: Pose2) -> float:
    """Distance of two poses [m]: a rotation counts by its arc at half the scan's radius."""
    rotation = math.remainder(one.theta - other.theta, 2.0 * math.pi)
    return math.hypot(one.x - other.x, one.y - other.y) + 0.5 * points.radius * abs(rotation)
