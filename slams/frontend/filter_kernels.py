"""Kernels of the motion filter: prediction by a motion model, wheels and gyro.

State z (14,): pose x, y [m], theta [rad] in the map; step since the last scan as a midpoint
increment (longitudinal, lateral [m], rotation [rad], in the frame at half of the rotation, so that
an error of the rotation does not move the end point); body twist [m/s, rad/s]; scale errors of the
wheels' distance and rotation [1]; gyro bias [rad/s]; heading drift of the wheels [rad/m], from
unequal diameters; delay of the scans' stamps against wheels and gyro [s]. P (14, 14) is its
covariance.

[Thrun05] S. Thrun, W. Burgard, D. Fox: Probabilistic Robotics, 2005.
"""

from __future__ import annotations

import math

import numpy as np

from slams.frontend.step_kernels import MAX_RATE_CHANGE, isolate
from slams.geometry import inverse3, wrap_angle
from slams.jit import njit
from slams.types import Floats

N = 14
POSE, STEP, TWIST, SCALE, BIAS, DRIFT, DELAY = 0, 3, 6, 9, 11, 12, 13
# rows of the readings of a step: distance, lateral and rotation by wheels; rotation by the gyro
GYRO = 3
# their columns: status, value, variance, change of the rate since the last step, variance as used;
# residual and variance at the last match
VALID, VALUE, VARIANCE, RATE_CHANGE, USED_VARIANCE, LAST_RESIDUAL, LAST_VARIANCE = range(7)
NIS_GATE = 9.0  # squared normalized innovation, three deviations: beyond it one side is wrong
FAULTY_FACTOR = 100.0  # of a reading's variance, ten deviations: the reading is not used
MAX_POSE_VARIANCE = 1e4  # m^2: the pose may be anywhere
MAX_NIS = 1e6  # that inflates a covariance
STAMP_STD = 0.01  # s, of one reading against its scan, in addition to the delay
MIN_MATCH_STD = np.array((0.0002, 0.0002, 0.0001))  # m, m, rad, however many beams a match has
# m, m, rad, added to a prior: a prior that is too tight would keep scans off the walls of the map
PRIOR_STD = np.array((0.002, 0.002, 0.001))
GYRO_BIAS_WALK = 1e-3  # rad/s after one second: bias random walk, far above a gyro's own


@njit(inner=True, borrows=True)
def scale_rows(P: Floats, first: int, last: int, factor: float) -> None:
    """Scale rows and columns first..last-1 of a covariance by a factor: P <- D P D. ours."""
    for i in range(first, last):
        for k in range(N):
            P[i, k] *= factor
    for k in range(first, last):
        for i in range(N):
            P[i, k] *= factor


@njit(inner=True)
def is_positive_definite(P: Floats) -> bool:
    """Whether the Cholesky factorization of P (14, 14) succeeds, with a tolerance. ours."""
    L = np.zeros((N, N))
    for i in range(N):
        for k in range(i + 1):
            total = P[i, k]
            for j in range(k):
                total -= L[i, j] * L[k, j]
            if i == k:
                if not total > 1e-13 * P[i, i]:  # what rounding may leave of a pivot
                    return False
                L[i, i] = math.sqrt(total)
            else:
                L[i, k] = total / L[k, k]
    return True


@njit(inner=True)
def symmetrize(P: Floats) -> None:
    """Make P symmetric and positive definite, in place.

    ours: mean of P and its transpose, plus a floor on the diagonal. Where rounding leaves it
    indefinite (variances are from 1e-10 to 1e4), correlations are reduced until it is not.
    """
    for i in range(N):
        for k in range(i):
            P[i, k] = P[k, i] = 0.5 * (P[i, k] + P[k, i])
        P[i, i] = max(P[i, i], 0.0) + 1e-10  # m^2, rad^2, ...: above rounding errors
    for i in range(N):
        for k in range(i):
            limit = math.sqrt(P[i, i] * P[k, k])
            P[i, k] = P[k, i] = min(max(P[i, k], -limit), limit)
    reduction = 1e-12
    while reduction < 1.0 and not is_positive_definite(P):
        reduction *= 10.0
        for i in range(N):
            for k in range(N):
                if i != k:
                    P[i, k] *= 1.0 - reduction


@njit(inner=True, borrows=True)
def propagate(z: Floats, P: Floats, dt: float, density: Floats, tau: Floats) -> None:
    """Propagate the twist by dt [s] as an Ornstein-Uhlenbeck process, and integrate the step.

    ours: d = tau (1 - exp(-dt / tau)) v, v' = exp(-dt / tau) v, driven by white acceleration of
    `density` (3,) [m^2/s^3, rad^2/s^3]; correlation time tau (3,) [s]. d replaces the last step.
    The gyro bias walks: what it learned from the first scans, whose map is inexact, is forgotten.
    """
    P[BIAS, BIAS] += GYRO_BIAS_WALK * GYRO_BIAS_WALK * dt
    for i in range(3):
        T = tau[i]
        decay = math.exp(-dt / T)
        loss = 1.0 - decay
        d, v = STEP + i, TWIST + i
        for k in range(N):  # rows, then columns: P <- F P F^T
            P[d, k] = T * loss * P[v, k]
            P[v, k] *= decay
        for k in range(N):
            P[k, d] = T * loss * P[k, v]
            P[k, v] *= decay
        z[d], z[v] = T * loss * z[v], decay * z[v]
        stationary = 0.5 * T * density[i]
        if dt < 1e-3 * T:  # the differences below would be lost in rounding
            P[d, d] += density[i] * dt * dt * dt / 3.0
        else:
            ramp = dt - 2.0 * T * loss + 0.5 * T * (1.0 - decay * decay)
            P[d, d] += 2.0 * stationary * T * ramp
        P[d, v] += stationary * T * loss * loss
        P[v, d] += stationary * T * loss * loss
        P[v, v] += stationary * (1.0 - decay * decay)


@njit(inner=True, borrows=True)
def fuse(z: Floats, P: Floats, H: Floats, residual: float, variance: float, buffer: Floats) -> None:
    """Kalman update with a scalar measurement, given its residual and row H (14,).

    ours: Joseph's form P <- (1 - K H) P (1 - K H)^T + K R K^T with one row. buffer (2, 14).
    """
    total = variance + times(P, H, buffer)
    for i in range(N):
        buffer[1, i] = buffer[0, i] / total
        z[i] += buffer[1, i] * residual
    for i in range(N):
        for k in range(N):
            joint = buffer[1, i] * buffer[0, k] + buffer[0, i] * buffer[1, k]
            P[i, k] += total * buffer[1, i] * buffer[1, k] - joint


@njit(inner=True, borrows=True)
def times(P: Floats, H: Floats, buffer: Floats) -> float:
    """H P H^T, at least 0; P H^T is left in buffer[0]. ours."""
    square = 0.0
    for i in range(N):
        buffer[0, i] = 0.0
        for k in range(N):
            buffer[0, i] += P[i, k] * H[k]
        square += H[i] * buffer[0, i]
    return max(square, 0.0)


@njit(inner=True, borrows=True)
def expected_value(
    z: Floats, i: int, motion: float, distance: float, dt: float, rate_change: float
) -> float:
    """The value of the i-th reading of a step with this motion along its axis and this distance.

    ours: wheels measure (1 + scale) times the step, plus heading drift; the gyro the rotation plus
    bias. Both are ahead of a scan that is stamped late, by the delay times the change of the rate.
    """
    expected: float = motion
    if i == GYRO:
        expected += dt * z[BIAS]
    elif i != 1:
        expected *= 1.0 + z[SCALE + i // 2]
        expected += z[DRIFT] * distance if i == 2 else 0.0
    expected += z[DELAY] * rate_change
    return expected


@njit(inner=True, borrows=True)
def linearize(z: Floats, dt: float, i: int, readings: Floats, H: Floats) -> float:
    """Row H (14,) of the i-th reading, and its residual, which is returned.

    ours: derivatives of `expected_value`. The derivative by a scale is the reading, so that stalled
    wheels do not change the scale.
    """
    H[:] = 0.0
    axis, change = 2 if i == GYRO else i, readings[i, RATE_CHANGE]
    H[STEP + axis], H[DELAY] = 1.0, change
    if i == GYRO:
        H[BIAS] = dt
    elif i != 1:
        scale = SCALE + i // 2
        H[STEP + i], H[scale] = 1.0 + z[scale], readings[i, VALUE]
        H[DRIFT] = readings[0, VALUE] if i == 2 else 0.0
    value: float = readings[i, VALUE]
    return value - expected_value(z, i, z[STEP + axis], readings[0, VALUE], dt, change)


@njit(inner=True, borrows=True)
def inflate(P: Floats, i: int, square: float, readings: Floats, buffer: Floats) -> None:
    """Inflate two variances by 1 + NIS where a reading and the prediction contradict.

    ours: either may be wrong. The fused mean stays, and its variance becomes that of a mixture of
    both. Along the reading's axis the step's error grows, and the twist's with it by regression:
    a match then decides about both. `square` of the residual; buffer[2]: the reading's row H.
    """
    nis = square / (times(P, buffer[2], buffer) + readings[i, USED_VARIANCE])
    if nis > NIS_GATE:
        nis, step = min(nis, MAX_NIS), STEP + (2 if i == GYRO else i)
        twist = step + TWIST - STEP
        slope = P[twist, step] / (P[step, step] + 1e-12)
        added = nis * P[step, step]
        P[step, step] += added
        P[twist, twist] += slope * slope * added
        P[step, twist] = P[twist, step] = P[twist, step] + slope * added
        readings[i, USED_VARIANCE] *= 1.0 + nis


@njit(inner=True, borrows=True)
def compose(z: Floats, P: Floats) -> None:
    """Compose the last pose with the step, in place. ours: covariance by exact derivatives."""
    theta, a, b, t = z[2], z[3], z[4], z[5]
    c, s = math.cos(theta + 0.5 * t), math.sin(theta + 0.5 * t)
    dx, dy = c * a - s * b, s * a + c * b
    for k in range(N):  # rows, then columns: P <- T P T^T
        p2, p3, p4, p5 = P[2, k], P[3, k], P[4, k], P[5, k]
        P[0, k] += -dy * p2 + c * p3 - s * p4 - 0.5 * dy * p5
        P[1, k] += dx * p2 + s * p3 + c * p4 + 0.5 * dx * p5
        P[2, k] += p5
    for k in range(N):
        p2, p3, p4, p5 = P[k, 2], P[k, 3], P[k, 4], P[k, 5]
        P[k, 0] += -dy * p2 + c * p3 - s * p4 - 0.5 * dy * p5
        P[k, 1] += dx * p2 + s * p3 + c * p4 + 0.5 * dx * p5
        P[k, 2] += p5
    z[0], z[1], z[2] = z[0] + dx, z[1] + dy, wrap_angle(theta + t)
    greatest = max(P[0, 0], P[1, 1], P[2, 2])
    if greatest > MAX_POSE_VARIANCE:
        scale_rows(P, POSE, STEP, math.sqrt(MAX_POSE_VARIANCE / greatest))


@njit
def predict(
    z: Floats,
    P: Floats,
    map_noise: Floats,
    dt: float,
    learned: Floats,
    tau: Floats,
    readings: Floats,
) -> None:
    """Predict over one interval dt [s]: propagate, fuse the readings, compose, in place.

    map_noise (3, 3) of the last pose in the map with which the next scan is matched; learned
    (2, 4): acceleration densities (3) and variance factors of the readings (4); tau (3,) [s],
    correlation times of the twist; readings (4, 7), see the columns. The noise of wheels is
    [Thrun05] 5.4. ours: a reading with a large factor is a fault, not noise, and is not used:
    stalled wheels would stop the estimate of a robot that drives in a bare corridor. A reading with
    a change of rate that no robot has is of another time, as that of a scan that was held back: it
    moves the step alone, and the twist stays.
    """
    P[:3, :3] += map_noise
    propagate(z, P, dt, learned[0], tau)
    buffer = np.empty((3, N))
    for i in range(4):
        stamp = STAMP_STD * readings[i, RATE_CHANGE]
        readings[i, VARIANCE] += stamp * stamp
        if readings[i, VALID] != 0.0 and learned[1, i] < FAULTY_FACTOR:
            readings[i, USED_VARIANCE] = readings[i, VARIANCE] * learned[1, i]
            residual = linearize(z, dt, i, readings, buffer[2])
            if abs(readings[i, RATE_CHANGE]) > MAX_RATE_CHANGE:
                residual += z[DELAY] * readings[i, RATE_CHANGE]  # it has no delay
                buffer[2, SCALE:] = 0.0
                isolate(P, STEP)
            inflate(P, i, residual * residual, readings, buffer)
            fuse(z, P, buffer[2], residual, readings[i, USED_VARIANCE], buffer)
    compose(z, P)
    symmetrize(P)


@njit
def prior(z: Floats, P: Floats, jitter: float, floor: Floats, out: Floats) -> None:
    """Covariance and information out (2, 3, 3) of the pose, and variances floor (3,) of a match.

    ours: a match has the error of its beams and, as the robot moves, of its stamp, which is off by
    `jitter` [s]. Covariance and information are those of the prior, before the match.
    """
    c, s = math.cos(z[2]), math.sin(z[2])
    velocity = c * z[TWIST] - s * z[TWIST + 1], s * z[TWIST] + c * z[TWIST + 1], z[TWIST + 2]
    out[0] = P[:3, :3]
    for i in range(3):
        floor[i] = MIN_MATCH_STD[i] ** 2 + (jitter * velocity[i]) ** 2
        out[0, i, i] += floor[i] + PRIOR_STD[i] ** 2
    out[1] = inverse3(out[0])
