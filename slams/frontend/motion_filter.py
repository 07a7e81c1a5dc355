"""MotionFilter: pose, twist and calibration of the sensors in one Kalman filter."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.frontend import filter_kernels as kernels
from slams.frontend import update_kernels
from slams.frontend.degeneracy import Observability
from slams.frontend.filter_kernels import GYRO, SCALE, TWIST
from slams.frontend.params import FrontendParams
from slams.frontend.timing import LaserTimings
from slams.frontend.wheels import WheelStep, WheelSteps
from slams.geometry import inverse3
from slams.types import Floats, Pose2, Scan, wrap_angle

# longitudinal, lateral, rotation
DENSITY = np.array((0.5, 0.01, 2.0))  # m^2/s^3, m^2/s^3, rad^2/s^3: accelerations of a robot
CARRIED = 0.5  # m^2/s^3: lateral, of a laser without wheels, which may be carried
MEMORY = np.array((100.0, 0.5, 10.0))  # s after which a twist is forgotten
TWIST_DEVIATION = np.array((0.7, 0.5, 1.0))  # m/s, m/s, rad/s: of a robot of which nothing is known
# 1, 1, rad/s, rad/m: wheels' scales, gyro's bias, drift of the wheels' heading
CALIBRATION = np.array((0.02, 0.05, 0.01, 0.01))
TICK = 0.001  # m, rad: deviation of a reading of the wheels at rest
GYRO_SCALE = 0.003  # 1
MAP_ERROR = np.array((0.0002, 0.0002, 0.0001))  # m, m, rad: of a match, however many beams it has
# m, m, rad, beside the covariance of a prior: it drew the map, and would hold poses off old walls
PRIOR_ERROR = np.array((0.002, 0.002, 0.001))
UNSEEN = 0.5  # s in which a robot does not drive there and back
LEARNING, JUDGING = 3.0, 2.0  # s over which accelerations and readings are learned
MOST_LEARNED = 0.1, 0.5  # share that one scan counts for in them at most


class Prediction(NamedTuple):
    """What is known of a pose before its scan is matched.

    The pose and its information (3, 3), the inverse of `covariance`; the body twist [m/s, rad/s];
    seconds since the scan before.
    """

    pose: Pose2
    information: Floats
    covariance: Floats
    twist: Pose2
    dt: float

    def distance(self, pose: Pose2) -> float:
        """Squared Mahalanobis distance of a pose from the prediction."""
        off = (pose.x - self.pose.x, pose.y - self.pose.y, wrap_angle(pose.theta - self.pose.theta))
        (a, b, c), (_, d, e), (_, _, f) = self.information.tolist()
        x, y, t = off
        cross = b * x * y + c * x * t + e * y * t
        square: float = a * x * x + d * y * y + f * t * t + 2.0 * cross
        return max(square, 0.0)


class MotionFilter:
    """The state of `filter_kernels` and what was learned of the robot.

    `wheels`: whether they measured the last step, and are not faulty.
    """

    def __init__(self, params: FrontendParams) -> None:
        self.wheels = False
        self._p = params
        self._z, self._P = np.zeros(kernels.N), np.zeros((kernels.N, kernels.N))
        self._P[SCALE:, SCALE:] = np.diag(CALIBRATION**2)
        self._P[:3, :3] = self._P[3:6, 3:6] = np.diag(MAP_ERROR**2)
        self._P[TWIST:SCALE, TWIST:SCALE] = np.diag(TWIST_DEVIATION**2)
        self._usual = DENSITY.copy()
        self._learned = np.ones((2, 4))
        self._learned[0, :3] = DENSITY
        self._readings = np.zeros((4, kernels.READING))
        self._wheels = WheelSteps()
        self._timing = LaserTimings(params.smooth_stamps)
        self._last: Scan | None = None
        self._before = np.zeros(3)
        self._dt = 0.0
        self._match, self._how = np.zeros((4, 3)), np.zeros((4, 3))
        self._entered = np.zeros((3, 3))  # of the last match: its noise that the map took in
        self._floor = MAP_ERROR**2

    @property
    def pose(self) -> Pose2:
        """The base in the map after the last call."""
        return Pose2(*self._z[:3].tolist())

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the pose [m, rad]."""
        return self._P[:3, :3]

    @property
    def gyro(self) -> bool:
        """Whether the gyro measured the last step, and is not faulty."""
        return bool(self._readings[GYRO, 0] and self._learned[1, GYRO] < kernels.FAULTY)

    @property
    def step(self) -> Pose2:
        """The last step as a midpoint increment [m, rad]."""
        return Pose2(*self._z[3:6].tolist())

    def predict(self, scan: Scan) -> Prediction:
        """Go on to the time of a scan, with what wheels and gyro measured of the step."""
        last, self._last = self._last, scan
        self._dt = dt = self._timing.elapsed(scan.t, scan.laser.mount)
        self._before[:] = self._z[:3]
        self.wheels = False
        wheels = self._wheels.take(scan.odometry, dt)
        if last is None:
            if scan.odometry is None:
                self._usual[1] = self._learned[0, 1] = CARRIED
        else:
            self._read(last, scan, wheels)
            self._P[:3, :3] += self._entered  # the scan is matched with a map that drifted so
            self._entered[:] = 0.0
            arrays = self._z, self._P, dt, self._learned, MEMORY, self._readings
            kernels.predict(*arrays)
        late = self._timing.jitter  # s: the robot was elsewhere then
        self._floor = MAP_ERROR**2 + (late * self._moving) ** 2
        return self.prediction()

    @property
    def _moving(self) -> Floats:
        """Speed along x and y of the map, and turn rate [m/s, rad/s]."""
        x, y, turn = self._z[TWIST:SCALE].tolist()
        c, s = math.cos(self._z[2]), math.sin(self._z[2])
        return np.array((c * x - s * y, s * x + c * y, turn))

    def prediction(self) -> Prediction:
        """The pose as it is known, as a prior of a match."""
        covariance = self._P[:3, :3].copy()
        covariance.flat[::4] += self._floor + PRIOR_ERROR**2
        twist = Pose2(*self._z[TWIST:SCALE].tolist())
        return Prediction(self.pose, inverse3(covariance), covariance, twist, self._dt)

    def twist_at(self, pose: Pose2) -> Pose2:
        """The body twist if the robot is at `pose`, by regression on it."""
        off = np.array((pose.x, pose.y, pose.theta)) - self._z[:3]
        off[2] = wrap_angle(float(off[2]))
        gain = self._P[TWIST:SCALE, :3] @ inverse3(self._P[:3, :3])
        return Pose2(*(self._z[TWIST:SCALE] + gain @ off).tolist())

    def update(self, pose: Pose2, information: Floats, seen: Observability) -> Pose2:
        """Condition on a match, fused with the prior, of which the scan has `information`.

        Returns it without what noise says along an unobservable direction.
        """
        self._match[0], self._match[1:] = pose, information
        p, dt = self._p, self._dt
        learning = min(dt / LEARNING, MOST_LEARNED[0]) if p.learn_acceleration else 0.0
        judging = min(dt / JUDGING, MOST_LEARNED[1]) if p.learn_odometry else 0.0
        self._how[0] = seen
        self._how[1] = dt, learning, judging
        self._how[2], self._how[3] = self._floor, self._floor + PRIOR_ERROR**2
        arrays = self._z, self._P, self._match, self._how, self._before
        update_kernels.update(*arrays, self._learned, self._usual, self._readings)
        self._entered[:] = self._match[1:]
        return Pose2(*self._match[0].tolist())

    def widen(self, factor: float) -> None:
        """The pose is less certain than it was taken for: its variances times `factor`."""
        self._P[:3, :] *= math.sqrt(factor)
        self._P[:, :3] *= math.sqrt(factor)

    def shift(self, pose: Pose2) -> None:
        """Another pose is known for the last scan: the robot is there, moving as before."""
        P = self._P
        P[:3, 3:] = P[3:, :3] = 0.0
        self._z[:3] = pose
        P[:3, :3] = np.diag(self._floor)

    def place(self, pose: Pose2, covariance: Floats) -> None:
        """The pose is given anew, at rest; what is known of wheels and gyro stays."""
        P = self._P
        P[:3, :] = P[:, :3] = 0.0
        P[TWIST:SCALE, :] = P[:, TWIST:SCALE] = 0.0
        self._z[:3], self._z[TWIST:SCALE] = pose, 0.0
        P[:3, :3] = covariance
        P[TWIST:SCALE, TWIST:SCALE] = np.diag(TWIST_DEVIATION**2)

    def _read_wheels(self, wheels: WheelStep, dt: float) -> None:
        """Of an increment over several scans the mean speed is that of the last interval."""
        p, readings, (x, y, turn) = self._p, self._readings, wheels.increment
        c, s = math.cos(0.5 * turn), math.sin(0.5 * turn)
        along, across = c * x + s * y, c * y - s * x
        # what a robot may have driven there and back in a long interval
        unseen = max(dt - UNSEEN, 0.0)
        way = abs(along) + 0.5 * float(TWIST_DEVIATION[0]) * unseen
        turned = abs(turn) + 0.5 * float(TWIST_DEVIATION[2]) * unseen
        aside, tick = p.slip_sideways**2, TICK**2
        readings[0, :3] = 1.0, along, p.slip**2 * way + aside * turned + tick
        readings[1, :3] = 1.0, across, aside * (way + turned) + tick
        readings[2, :3] = 1.0, turn, aside * way + p.slip_rotation**2 * turned + tick
        if wheels.seconds > dt > 0.0:
            share = dt / wheels.seconds
            readings[:3, 1] *= share
            readings[:3, 2] *= share * share
            readings[:3, 2] += DENSITY * (wheels.seconds - dt) * dt * dt / 3.0

    def _read(self, last: Scan, scan: Scan, wheels: WheelStep | None) -> None:
        """Readings of the step with their variances, [Thrun05] 5.4: by distance and rotation."""
        p, readings, dt = self._p, self._readings, self._dt
        readings[:, 0] = 0.0
        given = last.odometry is not None and scan.odometry is not None
        self.wheels = p.wheels and given and bool(self._learned[1, 0] < kernels.FAULTY)
        if p.wheels and wheels is not None:
            self._read_wheels(wheels, dt)
        if p.gyro and last.yaw is not None and scan.yaw is not None:
            turn = wrap_angle(scan.yaw - last.yaw)
            variance = p.gyro_noise**2 * dt + (GYRO_SCALE * turn) ** 2 + 1e-10
            readings[GYRO, :3] = 1.0, turn, variance
