"""EndPoints: the end points of the scan at hand, and the normals there."""

from __future__ import annotations

import math

import numpy as np

from slams.geometry import constant_twist_step
from slams.params import MAX_LASERS
from slams.scan import scan_kernels as kernels
from slams.scan.leveling import Leveling
from slams.scan.moving_average import MovingAverage
from slams.scan.params import ScanParams
from slams.scan.scan_kernels import Limits, Points, ScanResolution, Twist
from slams.types import IDENTITY, Laser, Pose2, Scan

NEAR = 0.1  # m, between two beams with a straight wall between them
SLACK = 0.1  # m, between neighbors of one surface
STRAY = 6.0  # deviations of the noise that two neighbors of one surface may differ by
SMOOTH = 6.0  # deviations of the noise in half a window, for a normal good to a tenth
OUTLIER = 3.0  # deviations of the noise from which a beam is not on its neighbors' wall
SAMPLES = 10  # triples of beams, fewer tell nothing of the noise
NORMAL_MEDIAN = 0.6724  # of the absolute value of a normal deviate that is no `OUTLIER`
TRIPLE = math.sqrt(1.5)  # deviation of a beam less the mean of two others, of one beam's
FAR_APART, LONG = 1.0, 30.0  # s between scans at most, s over which that is a mean
MEMORY = 1.0  # s over which the noise is a mean: five scans of a slow laser, and a robot's length


class EndPoints:
    """End points of the scan at hand, in the base frame at the middle of its sweep, leveled.

    There a velocity that is not quite right does least harm: what it bends before the middle, it
    bends the other way behind it. `at_stamp` goes back to the scan's stamp, that of its first beam.

    `points` (3, >= n): x, y [m], number of the beam; `far` [m] the farthest from the base. The
    buffers serve every scan.
    """

    rough_normal_error = 0.14  # rad, deviation of `facing`: of a chord of a few beams

    def __init__(self, params: ScanParams) -> None:
        self.params = params
        self.n = 0
        self.radius = 0.0
        self._noise = MovingAverage(MEMORY, params.range_noise)
        self._noises: dict[Pose2, MovingAverage] = {}  # by mounts: of each laser
        self._apart, self._t = MovingAverage(LONG), math.inf
        self._summed = self._known = self._chorded = False  # moments, normals, chords
        self.mount = IDENTITY
        self.step = 0.0
        self.has_sweep = False
        self._velocity = IDENTITY
        self._leveling = Leveling()
        self._laser: Laser | None = None
        self._size(1)

    def read(self, scan: Scan, velocity: Pose2) -> EndPoints:
        """Read a scan; `velocity` of the base [m/s, rad/s] takes out the motion of the sweep."""
        laser = scan.laser
        if laser is not self._laser:
            self._adopt(laser, len(scan.ranges))
        self._summed = self._known = self._chorded = False
        self.n, self.radius = kernels.end_points(
            scan.ranges, self._directions, laser.mount, self._limits, self.points
        )
        self.mount = laser.mount
        leveled = self._leveling.project(scan, velocity, self.points, self.n, self._room)
        if leveled is not None:
            self.n, self.radius, self.mount = leveled
        self._measure_noise(scan.t)
        self._measure_apart(scan.t)
        self.n = kernels.remove_isolated(
            self.points, self.n, self.mount, self.step, self.resolution.slack, self._room
        )
        if self.has_sweep:
            self._velocity = velocity
            twist = Twist(*velocity, laser.time_increment, 0.5 * (laser.n_beams - 1))
            kernels.deskew(self.points, self.n, twist)
        return self

    def at_stamp(self, pose: Pose2) -> Pose2:
        """The base's pose at the stamp of the scan that was matched at `pose`."""
        if not self.has_sweep or self._laser is None:
            return pose
        return pose @ constant_twist_step(self._velocity, -0.5 * self._laser.sweep_time)

    @property
    def counts(self) -> dict[str, int]:
        """Of scans: leveled by their attitude, and those whose attitude is wrong; of `Leveling`."""
        return self._leveling.counts

    @property
    def noise(self) -> float:
        """Of the ranges [m], as the last scans show it."""
        return self._noise.value

    @property
    def scan_interval(self) -> float:
        """How far scans are apart [s], one second at most; 0 until there were two."""
        return self._apart.value

    @property
    def moments(self) -> Points:
        """Running sums along the scan, and where its surfaces begin (6, n + 1): `scan_moments`."""
        if not self._summed:
            kernels.scan_moments(
                self.points, self.n, self.mount, self.step, self.resolution.slack, self._moments
            )
            self._summed = True
        return self._moments

    @property
    def normals(self) -> Points:
        """Of every end point the normal and the gap to its neighbors (3, >= n)."""
        if not self._known:
            kernels.scan_normals(
                self.points,
                self.n,
                self.mount,
                self.step,
                self.resolution,
                self.moments,
                self._room,
            )
            self._known = True
        return self._room

    @property
    def rough_normals(self) -> Points:
        """Which way the surface at every end point faces, and the gap there (3, >= n).

        Normals where they are known already; to tell faces apart vectors across chords do as well.
        """
        if self._known:
            return self._room
        if not self._chorded:
            kernels.chords(
                self.points, self.n, self.mount, self.step, self.resolution, self._chords
            )
            self._chorded = True
        return self._chords

    @property
    def resolution(self) -> ScanResolution:
        """How fine the scan is, by its noise."""
        window = max(self.params.normal_window, SMOOTH * self.noise)
        return ScanResolution(self.noise, window, max(SLACK, STRAY * self.noise))

    def _measure_noise(self, t: float) -> None:
        """Where beams are so close together that a wall between them is straight."""
        if self._noise.is_fresh(t):
            return
        room = self._room[0]
        most = OUTLIER * self.noise
        count = kernels.beyond_chords(self.points, self.n, self.mount, NEAR, most, room)
        if count >= SAMPLES:
            half = count // 2
            found = float(np.partition(room[:count], half)[half]) / (NORMAL_MEDIAN * TRIPLE)
            self._noise.learn(min(max(found, self.params.quietest), self.params.noisiest), t)

    def _measure_apart(self, t: float) -> None:
        """By stamps that go on; a second scan of the same time is the same scan."""
        if t > self._t:
            self._apart.learn(min(t - self._t, FAR_APART), t)
        self._t = t

    def _adopt(self, laser: Laser, n_beams: int) -> None:
        self._laser, self.step = laser, abs(laser.angle_increment)
        if len(self._noises) == MAX_LASERS and laser.mount not in self._noises:
            self._noises.clear()
        usual = MovingAverage(MEMORY, self.params.range_noise)
        self._noise = self._noises.setdefault(laser.mount, usual)
        self._directions = laser.directions
        self.has_sweep = self.params.deskew and laser.time_increment > 0.0
        near = max(self.params.min_range, laser.range_min)
        self._limits = Limits(near, self.params.max_range)
        if n_beams > self.points.shape[1]:
            self._size(n_beams)

    def _size(self, n_beams: int) -> None:
        self.points = np.zeros((3, n_beams))
        self._room = np.zeros((3, n_beams))
        self._chords = np.zeros((3, n_beams))
        self._moments = np.zeros((6, n_beams + 1))


def pose_distance(points: EndPoints, one: Pose2, other: Pose2) -> float:
    """Distance of two poses [m], as the end points half way out see it."""
    turn = math.remainder(one.theta - other.theta, 2.0 * math.pi)
    return math.hypot(one.x - other.x, one.y - other.y) + 0.5 * points.radius * abs(turn)
