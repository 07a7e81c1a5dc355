"""MotionFilter: Kalman filter of pose, twist and calibration of wheels and gyro."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.frontend import filter_kernels as kernels
from slams.frontend import update_kernels
from slams.frontend.degeneracy import Observability
from slams.frontend.filter_kernels import (
    GYRO,
    MIN_MATCH_STD,
    RATE_CHANGE,
    SCALE,
    TWIST,
    VALUE,
    VARIANCE,
)
from slams.frontend.params import FrontendParams
from slams.frontend.step_kernels import is_jump, midpoint_step
from slams.frontend.timing import MIN_LASER_OFFSET, LaserTimings
from slams.frontend.wheels import WheelStep, WheelSteps
from slams.geometry import inverse3
from slams.types import Floats, Pose2, Scan, wrap_angle

# longitudinal, lateral, rotation
ACCELERATION_DENSITY = np.array((0.5, 0.01, 2.0))  # m^2/s^3, m^2/s^3, rad^2/s^3: white noise
HANDHELD_LATERAL_DENSITY = 0.5  # m^2/s^3, of a laser without wheels, which may be carried
TWIST_CORRELATION_TIME = np.array((100.0, 0.5, 10.0))  # s, of the Ornstein-Uhlenbeck process
TWIST_STD = np.array((0.7, 0.5, 1.0))  # m/s, m/s, rad/s, of an unknown robot
# 1, 1, rad/s, rad/m, s: scales of the wheels, gyro bias, heading drift of the wheels, delay
CALIBRATION_STD = np.array((0.02, 0.05, 0.01, 0.01, 0.03))
ZERO_VELOCITY_STD = 0.001  # m, rad, of a reading of the wheels at rest
GYRO_SCALE_STD = 0.003  # 1
MIN_REVERSAL_TIME = 0.5  # s, within which a robot does not drive away and back
# s over which acceleration densities and variance factors of readings are learned
DENSITY_LEARNING_TIME, FACTOR_LEARNING_TIME = 3.0, 2.0
MAX_DENSITY_RATE, MAX_FACTOR_RATE = 0.1, 0.5  # learning rate of one scan


class Prediction(NamedTuple):
    """Predicted pose of a scan, its information and covariance (3, 3) [m, rad].

    `twist` of the body [m/s, rad/s], `dt` since the last scan [s], `wheels`: whether used.
    """

    pose: Pose2
    information: Floats
    covariance: Floats
    twist: Pose2
    dt: float
    wheels: bool = False

    def mahalanobis_squared(self, pose: Pose2) -> float:
        """Squared Mahalanobis distance of a pose from the prediction."""
        x, y = pose.x - self.pose.x, pose.y - self.pose.y
        t = wrap_angle(pose.theta - self.pose.theta)
        (a, b, c), (_, d, e), (_, _, f) = self.information.tolist()
        cross = b * x * y + c * x * t + e * y * t
        square: float = a * x * x + d * y * y + f * t * t + 2.0 * cross
        return max(square, 0.0)


class MotionFilter:
    """State of `filter_kernels`, and the noise that was learned.

    `wheels`: whether wheels measured the last step and are not faulty.
    """

    def __init__(self, params: FrontendParams) -> None:
        self.wheels = False
        self._p = params
        self._z, self._P = np.zeros(kernels.N), np.zeros((kernels.N, kernels.N))
        self._P[SCALE:, SCALE:] = np.diag(CALIBRATION_STD**2)
        self._P[:3, :3] = self._P[3:6, 3:6] = np.diag(MIN_MATCH_STD**2)
        self._P[TWIST:SCALE, TWIST:SCALE] = np.diag(TWIST_STD**2)
        self._default_density = ACCELERATION_DENSITY.copy()
        self._learned = np.ones((2, 4))  # acceleration densities; variance factors of the readings
        self._learned[0, :3] = ACCELERATION_DENSITY
        self._readings = np.zeros((4, 7))  # see the columns in `filter_kernels`
        self._wheel_steps = WheelSteps()
        self._gyro_rate = math.nan  # rad/s, in the last step
        self._timing = LaserTimings(params.smooth_stamps)
        self._last_scan: Scan | None = None
        # pose of the last scan; rate of the last step that was matched
        self._last = np.zeros(3), np.full(3, np.nan)
        self._dt = 0.0
        self._map_noise = np.zeros((3, 3))  # covariance that the last match added to the map
        self._noise_floor = MIN_MATCH_STD**2  # variances of a match by its stamp and the map

    @property
    def pose(self) -> Pose2:
        """The base in the map after the last call."""
        return Pose2(*self._z[:3].tolist())

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the pose [m, rad] relative to the map around it."""
        return self._P[:3, :3]

    @property
    def gyro(self) -> bool:
        """Whether the gyro measured the last step and is not faulty."""
        return bool(self._readings[GYRO, 0] and self._learned[1, GYRO] < kernels.FAULTY_FACTOR)

    @property
    def delay(self) -> float:
        """Learned delay of the scans' stamps against wheels and gyro [s]."""
        return float(self._z[kernels.DELAY])

    def predict(self, scan: Scan) -> Prediction:
        """Predict the state at a scan, by the motion so far and the readings of wheels and gyro."""
        scan = scan.at_mid_sweep
        last, self._last_scan = self._last_scan, scan
        self._dt = dt = self._timing.elapsed(scan.t, scan.laser.mount)
        self._last[0][:] = self._z[:3]
        self.wheels = False
        wheels = self._wheel_steps.take(scan.odometry, dt)
        if last is None:
            if scan.odometry is None:
                self._default_density[1] = self._learned[0, 1] = HANDHELD_LATERAL_DENSITY
        else:
            self._read(last, scan, wheels)
            state, learned = (self._z, self._P, self._map_noise), self._learned
            kernels.predict(*state, dt, learned, TWIST_CORRELATION_TIME, self._readings)
            self._map_noise = np.zeros((3, 3))
        return self.prediction()

    def prediction(self) -> Prediction:
        """The pose of the state as the prior of a match."""
        prior = np.empty((2, 3, 3))
        kernels.prior(self._z, self._P, self._timing.jitter, self._noise_floor, prior)
        covariance, information = prior
        twist = Pose2(*self._z[TWIST:SCALE].tolist())
        return Prediction(self.pose, information, covariance, twist, self._dt, self.wheels)

    def twist_at(self, pose: Pose2) -> Pose2:
        """The body twist [m/s, rad/s] by regression, if the robot is at `pose` without a jump."""
        (last_pose, last_rate), at, step = self._last, np.array(pose), np.empty(3)
        midpoint_step(last_pose, at, step)
        if is_jump(step, self._dt, last_rate):
            return Pose2(*self._z[TWIST:SCALE].tolist())
        difference = at - self._z[:3]
        difference[2] = wrap_angle(float(difference[2]))
        gain = self._P[TWIST:SCALE, :3] @ inverse3(self._P[:3, :3])
        return Pose2(*(self._z[TWIST:SCALE] + gain @ difference).tolist())

    def update(self, pose: Pose2, information: Floats, observed: Observability) -> Pose2:
        """Condition on a match; return its pose, remapped along a degenerate direction.

        `pose` is the scan fused with the prior, `information` (3, 3) that of the scan alone.
        """
        p, dt = self._p, self._dt
        density_rate = p.learn_acceleration * min(dt / DENSITY_LEARNING_TIME, MAX_DENSITY_RATE)
        factor_rate = p.learn_odometry * min(dt / FACTOR_LEARNING_TIME, MAX_FACTOR_RATE)
        how = tuple(observed), (dt, density_rate, factor_rate)
        self._map_noise = information.copy()
        match, learning = (tuple(pose), self._map_noise), (self._learned, self._default_density)
        arrays = self._noise_floor, self._last, learning, self._readings
        return Pose2(*update_kernels.update(self._z, self._P, match, how, *arrays))

    def inflate(self, factor: float) -> None:
        """Multiply the variances of the pose by a factor."""
        self._P[:3, :] *= math.sqrt(factor)
        self._P[:, :3] *= math.sqrt(factor)

    def shift(self, pose: Pose2) -> None:
        """Replace the pose of the last scan, as a match does; the twist stays."""
        P = self._P
        P[:3, 3:] = P[3:, :3] = 0.0
        self._z[:3] = pose
        P[:3, :3] = np.diag(self._noise_floor)

    def set_pose(self, pose: Pose2, covariance: Floats) -> None:
        """Restart at a pose, at rest; the calibration of wheels and gyro stays."""
        self.shift(pose)
        P = self._P
        self._z[TWIST:SCALE] = 0.0
        P[TWIST:SCALE, :] = P[:, TWIST:SCALE] = 0.0
        P[TWIST:SCALE, TWIST:SCALE] = np.diag(TWIST_STD**2)
        P[:3, :3] = covariance

    def _read_wheels(self, wheels: WheelStep, dt: float) -> None:
        """Readings of an increment; one over several scans gives the mean speed of the last."""
        p, readings, (x, y, rotation) = self._p, self._readings, wheels.increment
        change, delay = wheels.rate_change, self.delay
        c, s = math.cos(0.5 * rotation), math.sin(0.5 * rotation)
        longitudinal, lateral = c * x + s * y, c * y - s * x
        # the noise is that of the scan's step, or of the predicted step where wheels stall;
        # motion away and back in a long interval is hidden
        speed, _, rate = self._z[TWIST:SCALE].tolist()
        hidden = 0.5 * max(dt - MIN_REVERSAL_TIME, 0.0)
        distance = max(abs(longitudinal - delay * change.x), dt * abs(speed))
        turned = max(abs(rotation - delay * change.theta), dt * abs(rate))
        distance, turned = distance + hidden * TWIST_STD[0], turned + hidden * TWIST_STD[2]
        sideways, rest = p.slip_sideways**2, ZERO_VELOCITY_STD**2
        readings[0, :3] = 1.0, longitudinal, p.slip**2 * distance + sideways * turned + rest
        readings[1, :3] = 1.0, lateral, sideways * (distance + turned) + rest
        readings[2, :3] = 1.0, rotation, sideways * distance + p.slip_rotation**2 * turned + rest
        readings[:3, RATE_CHANGE] = change.x, 0.0, change.theta
        if wheels.seconds > dt > 0.0:
            share = dt / wheels.seconds
            readings[:3, [VALUE, RATE_CHANGE]] *= share
            readings[:3, VARIANCE] *= share * share
            readings[:3, VARIANCE] += ACCELERATION_DENSITY * (wheels.seconds - dt) * dt * dt / 3.0

    def _read(self, last: Scan, scan: Scan, wheels: WheelStep | None) -> None:
        """Readings of the step with their variances, by distance and rotation [Thrun05] 5.4."""
        p, readings, dt = self._p, self._readings, self._dt
        readings[:, :4] = 0.0
        measured = last.odometry is not None and scan.odometry is not None
        self.wheels = p.wheels and measured and bool(self._learned[1, 0] < kernels.FAULTY_FACTOR)
        if p.wheels and wheels is not None:
            self._read_wheels(wheels, dt)
        if not p.gyro or last.yaw is None or scan.yaw is None:
            self._gyro_rate = math.nan
        elif dt > MIN_LASER_OFFSET:
            rotation = wrap_angle(scan.yaw - last.yaw)
            variance = p.gyro_noise**2 * dt + (GYRO_SCALE_STD * rotation) ** 2 + 1e-10
            last_rate, self._gyro_rate = self._gyro_rate, rotation / dt
            change = 0.0 if math.isnan(last_rate) else self._gyro_rate - last_rate
            readings[GYRO, :4] = 1.0, rotation, variance, change
