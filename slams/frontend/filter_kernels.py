"""Kernels of the motion filter: propagate, fuse wheels and gyro, compose, condition on a match.

State z (13,): pose x, y [m], theta [rad] in the map; step since the scan before as a midpoint
increment (longitudinal, lateral [m], rotation [rad]: seen from the heading half way, where an error
of the rotation moves the end neither along nor across); body twist [m/s, rad/s]; scale errors of
the wheels' distance and rotation [1]; bias of the gyro [rad/s]; drift of the wheels' heading
[rad/m], of wheels that differ. P (13, 13) is its covariance.

[Thrun05] S. Thrun, W. Burgard, D. Fox: Probabilistic Robotics, 2005.
[Roth13] M. Roth, E. Ozkan, F. Gustafsson: A Student's t filter for heavy tailed process and
measurement noise. ICASSP 2013.
[SageHusa69] A. Sage, G. Husa: Adaptive filtering with unknown prior statistics. JACC 1969.
[Zhang16] J. Zhang, M. Kaess, S. Singh: On Degeneracy of Optimization-based State Estimation
Problems. ICRA 2016.
"""

from __future__ import annotations

import math

import numpy as np

from slams.geometry import STUDENT_DOF, wrap_angle
from slams.jit import njit
from slams.types import Floats

N = 13
POSE, STEP, TWIST, SCALE, BIAS, DRIFT = 0, 3, 6, 9, 11, 12
# rows of the readings of one step: wheels' distance, sideways, rotation; gyro's rotation
VALID, VALUE, VARIANCE, USED = 0, 1, 2, 3  # its own variance, and the one that was used
RESIDUAL, ITS_VARIANCE = 4, 5  # of the reading of the last step that was matched
READING = 6  # numbers of one
GYRO = 3
CONTRADICTED = 9.0  # NIS beyond which a reading and the prediction contradict each other
FAULTY = 100.0  # factor of a reading's variance from which it says nothing: ten deviations
FLOOR = 1e-10  # m^2, rad^2, ...: added to every variance, above rounding of the largest
ROUNDING = 1e-13  # of a variance: what is left of it after the others must be more
FARTHEST = 1e4  # m^2, variance of a pose that may be anywhere: it grows no more
LARGEST = 1e6  # NIS that widens a covariance at most


@njit(inner=True, borrows=True)
def scale_rows(P: Floats, first: int, last: int, by: float) -> None:
    """Scale rows and columns first..last-1 of a covariance: P <- D P D. ours."""
    for i in range(first, last):
        for k in range(N):
            P[i, k] *= by
    for k in range(first, last):
        for i in range(N):
            P[i, k] *= by


@njit(inner=True)
def is_positive_definite(P: Floats) -> bool:
    """Whether Cholesky's factorization of P (13, 13) succeeds, with a margin for rounding. ours."""
    L = np.zeros((N, N))
    for i in range(N):
        for k in range(i + 1):
            total = P[i, k]
            for j in range(k):
                total -= L[i, j] * L[k, j]
            if i == k:
                if not total > ROUNDING * P[i, i]:
                    return False
                L[i, i] = math.sqrt(total)
            else:
                L[i, k] = total / L[k, k]
    return True


@njit(inner=True)
def symmetrize(P: Floats) -> None:
    """Mean of P and its transpose, plus a floor on the diagonal; smaller correlations if needed.

    ours: variances of 1e4 m^2 beside 1e-10 leave differences that rounding makes negative.
    """
    for i in range(N):
        for k in range(i):
            P[i, k] = P[k, i] = 0.5 * (P[i, k] + P[k, i])
        P[i, i] = max(P[i, i], 0.0) + FLOOR
    for i in range(N):
        for k in range(i):
            most = math.sqrt(P[i, i] * P[k, k])
            P[i, k] = P[k, i] = min(max(P[i, k], -most), most)
    less = 1e-12
    while less < 1.0 and not is_positive_definite(P):
        less *= 10.0
        for i in range(N):
            for k in range(N):
                if i != k:
                    P[i, k] *= 1.0 - less


@njit(inner=True, borrows=True)
def propagate(z: Floats, P: Floats, dt: float, density: Floats, memory: Floats) -> None:
    """Go on by dt [s]: Ornstein-Uhlenbeck twist, and the step that it makes.

    ours: d = tau (1 - exp(-dt / tau)) v, v' = exp(-dt / tau) v, driven by white acceleration of
    `density` (3,) [m^2/s^3, rad^2/s^3]; `memory` (3,) is tau [s]. The old step is forgotten.
    """
    for i in range(3):
        tau = memory[i]
        keep = math.exp(-dt / tau)
        gone = 1.0 - keep
        d, v = STEP + i, TWIST + i
        for k in range(N):  # rows, then columns: P <- F P F^T
            P[d, k] = tau * gone * P[v, k]
            P[v, k] *= keep
        for k in range(N):
            P[k, d] = tau * gone * P[k, v]
            P[k, v] *= keep
        z[d], z[v] = tau * gone * z[v], keep * z[v]
        stationary = 0.5 * tau * density[i]
        if dt < 1e-3 * tau:  # the differences below are lost in rounding
            P[d, d] += density[i] * dt * dt * dt / 3.0
        else:
            ramp = dt - 2.0 * tau * gone + 0.5 * tau * (1.0 - keep * keep)
            P[d, d] += 2.0 * stationary * tau * ramp
        P[d, v] += stationary * tau * gone * gone
        P[v, d] += stationary * tau * gone * gone
        P[v, v] += stationary * (1.0 - keep * keep)


@njit(inner=True, borrows=True)
def fuse(z: Floats, P: Floats, H: Floats, residual: float, variance: float, room: Floats) -> None:
    """Kalman update with one number whose residual and row H (13,) are given, in Joseph's form.

    ours: of the general form P <- (1 - K H) P (1 - K H)^T + K R K^T with one row. room (2, 13).
    """
    total = variance + times(P, H, room)
    for i in range(N):
        room[1, i] = room[0, i] / total
        z[i] += room[1, i] * residual
    for i in range(N):
        for k in range(N):
            joint = room[1, i] * room[0, k] + room[0, i] * room[1, k]
            P[i, k] += total * room[1, i] * room[1, k] - joint


@njit(inner=True, borrows=True)
def times(P: Floats, H: Floats, room: Floats) -> float:
    """H P H^T, at least 0; P H^T is left in room[0]. ours."""
    square = 0.0
    for i in range(N):
        room[0, i] = 0.0
        for k in range(N):
            room[0, i] += P[i, k] * H[k]
        square += H[i] * room[0, i]
    return max(square, 0.0)


@njit(inner=True, borrows=True)
def linearize(z: Floats, dt: float, i: int, readings: Floats, H: Floats) -> float:
    """Row H (13,) of a reading and its residual: (1 + scale) step, or rotation plus bias. ours."""
    H[:] = 0.0
    if i == GYRO:
        H[STEP + 2], H[BIAS] = 1.0, dt
        expected = z[STEP + 2] + dt * z[BIAS]
    elif i == 1:
        H[STEP + 1] = 1.0
        expected = z[STEP + 1]
    else:
        scale = SCALE + (1 if i == 2 else 0)
        H[STEP + i], H[scale] = 1.0 + z[scale], readings[i, VALUE]
        expected = (1.0 + z[scale]) * z[STEP + i]
        if i == 2:
            H[DRIFT] = readings[0, VALUE]
            expected += z[DRIFT] * readings[0, VALUE]
    residual: float = readings[i, VALUE] - expected
    return residual


@njit(inner=True, borrows=True)
def widen(P: Floats, i: int, square: float, readings: Floats, room: Floats) -> None:
    """Where a reading and the prediction contradict each other, either may be wrong [Roth13].

    ours: beyond the gate the normalized innovation squared widens both alike, the reading and the
    step and twist along its axis: a jump in distance says nothing of the predicted rotation.
    `square` of the residual; room[2] the reading's row H.
    """
    nis = square / (times(P, room[2], room) + readings[i, USED])
    if nis > CONTRADICTED:
        factor = (STUDENT_DOF + min(nis, LARGEST)) / (STUDENT_DOF + 1.0)
        axis = 2 if i == GYRO else i
        scale_rows(P, STEP + axis, STEP + axis + 1, math.sqrt(factor))
        scale_rows(P, TWIST + axis, TWIST + axis + 1, math.sqrt(factor))
        readings[i, USED] *= factor


@njit(inner=True, borrows=True)
def compose(z: Floats, P: Floats) -> None:
    """Pose of this scan: the pose before, moved on by the step. ours: exact first derivatives."""
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
    widest = max(P[0, 0], P[1, 1], P[2, 2])
    if widest > FARTHEST:
        scale_rows(P, POSE, STEP, math.sqrt(FARTHEST / widest))


@njit
def predict(
    z: Floats, P: Floats, dt: float, learned: Floats, memory: Floats, readings: Floats
) -> None:
    """One interval: propagate, fuse the readings of wheels and gyro, compose.

    learned (2, 4): densities of acceleration (3), factors of the readings' variances (4); readings
    (4, 6): whether it is valid, value [m, rad], variance, variance used. Wheels measure (1 +
    scale) times the step ([Thrun05] 5.4 for their noise), the gyro the rotation plus its bias. The
    derivative by a scale is the reading: wheels that stall say nothing of it. Such faults are no
    noise, and would brake a robot that nothing else holds: beyond `FAULTY` they are left out.
    """
    propagate(z, P, dt, learned[0], memory)
    room = np.empty((3, N))
    for i in range(4):
        if readings[i, VALID] != 0.0 and learned[1, i] < FAULTY:
            readings[i, USED] = readings[i, VARIANCE] * learned[1, i]
            residual = linearize(z, dt, i, readings, room[2])
            widen(P, i, residual * residual, readings, room)
            fuse(z, P, room[2], residual, readings[i, USED], room)
    compose(z, P)
    symmetrize(P)
