"""Kernels of the motion filter: propagate, fuse wheels and gyro, compose, condition on a match.

State z (12,): pose x, y [m], theta [rad] in the map; step since the scan before as a midpoint
increment (longitudinal, lateral [m], rotation [rad]: seen from the heading half way, where an error
of the rotation moves the end neither along nor across); body twist [m/s, rad/s]; scale errors of
the wheels' distance and rotation [1]; bias of the gyro [rad/s]. P (12, 12) is its covariance.

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

from slams.geometry import FREEDOM, inverse3, wrap_angle
from slams.jit import njit
from slams.types import Floats

N = 12
POSE, STEP, TWIST, SCALE, BIAS = 0, 3, 6, 9, 11
# rows of the readings of one step: wheels' distance, sideways, rotation; gyro's rotation
VALID, VALUE, VARIANCE = 0, 1, 2
GYRO = 3
GATE = 9.0  # NIS beyond which a reading and the prediction contradict each other
FLOOR = 1e-12  # m^2, rad^2, ...: added to every variance, keeps P positive definite
FARTHEST = 1e4  # m^2, variance of a pose that may be anywhere: it grows no more
WEAKEST = 1e-4  # 1/m^2, 1/rad^2: information added where a match has none
SHARPEST = 10.0  # NIS of one match that counts at most, in what is learned
SLOWEST = 0.1  # least share of a twist's variance that a match has to remove, to be learned from
SPREAD = 100.0  # times the usual acceleration density, at most and at least


@njit(inner=True, borrows=True)
def scale_rows(P: Floats, first: int, last: int, by: float) -> None:
    """Scale rows and columns first..last-1 of a covariance: P <- D P D. ours."""
    for i in range(first, last):
        for k in range(N):
            P[i, k] *= by
    for k in range(first, last):
        for i in range(N):
            P[i, k] *= by


@njit(inner=True, borrows=True)
def symmetrize(P: Floats) -> None:
    """Mean of P and its transpose, plus a floor on the diagonal. ours: against rounding."""
    for i in range(N):
        for k in range(i):
            P[i, k] = P[k, i] = 0.5 * (P[i, k] + P[k, i])
        P[i, i] += FLOOR


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
    """Kalman update with one number whose residual and row H (12,) are given, in Joseph's form.

    [Roth13]: where the normalized innovation squared is beyond the gate either side may be wrong;
    step and twist, and the reading's variance, are widened alike. room (2, 12).
    """
    known = 0.0
    for i in range(N):
        room[0, i] = 0.0
        for k in range(N):
            room[0, i] += P[i, k] * H[k]
        known += H[i] * room[0, i]
    known = max(known, 0.0)
    nis = residual * residual / (known + variance)
    if nis > GATE:
        widen = (FREEDOM + nis) / (FREEDOM + 1.0)
        scale_rows(P, STEP, SCALE, math.sqrt(widen))
        variance *= widen
        known = 0.0
        for i in range(N):
            room[0, i] = 0.0
            for k in range(N):
                room[0, i] += P[i, k] * H[k]
            known += H[i] * room[0, i]
        known = max(known, 0.0)
    total = known + variance
    for i in range(N):
        room[1, i] = room[0, i] / total
        z[i] += room[1, i] * residual
    for i in range(N):
        for k in range(N):
            joint = room[1, i] * room[0, k] + room[0, i] * room[1, k]
            P[i, k] += total * room[1, i] * room[1, k] - joint


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
    (4, 3): whether it is valid, value [m, rad], variance. Wheels measure (1 + scale) times the step
    ([Thrun05] 5.4 for their noise), the gyro the rotation plus its bias. The derivative by a
    scale is the reading: wheels that stall say nothing of it.
    """
    propagate(z, P, dt, learned[0], memory)
    room = np.empty((3, N))
    H = room[2]
    for i in range(4):
        if readings[i, VALID] == 0.0:
            continue
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
        variance = readings[i, VARIANCE] * learned[1, i]
        fuse(z, P, H, readings[i, VALUE] - expected, variance, room)
    compose(z, P)
    symmetrize(P)


@njit(inner=True, borrows=True)
def offset_from(z: Floats, pose: Floats, out: Floats) -> None:
    """Difference of a pose (3,) from the state's. ours."""
    out[0], out[1] = pose[0] - z[0], pose[1] - z[1]
    out[2] = wrap_angle(pose[2] - z[2])


@njit(inner=True, borrows=True)
def mahalanobis(information: Floats, off: Floats) -> float:
    """Squared distance off^T information off of a difference (3,). ours."""
    square = 0.0
    for i in range(3):
        for k in range(3):
            square += off[i] * information[i, k] * off[k]
    return max(square, 0.0)


@njit(inner=True)
def condition(z: Floats, P: Floats, pose: Floats, covariance: Floats) -> None:
    """The pose is now `pose` with `covariance`; all other states follow by regression on it.

    ours: z += G off, P <- P - G P_pp G^T + G C G^T with G = P[:, :3] P_pp^-1, for any filter whose
    posterior of the pose has a mean and a covariance (a particle cloud's as well).
    """
    inverse = inverse3(P[:3, :3])
    G, off, change = np.empty((N, 3)), np.empty(3), np.empty((3, 3))
    offset_from(z, pose, off)
    for i in range(N):
        for k in range(3):
            G[i, k] = P[i, 0] * inverse[0, k] + P[i, 1] * inverse[1, k] + P[i, 2] * inverse[2, k]
    for i in range(3):
        for k in range(3):
            change[i, k] = covariance[i, k] - P[i, k]
    for i in range(3, N):
        z[i] += G[i, 0] * off[0] + G[i, 1] * off[1] + G[i, 2] * off[2]
        for k in range(3, N):
            total = 0.0
            for j in range(3):
                moved = change[j, 0] * G[k, 0] + change[j, 1] * G[k, 1] + change[j, 2] * G[k, 2]
                total += G[i, j] * moved
            P[i, k] += total
        for k in range(3):
            moved = G[i, 0] * covariance[0, k] + G[i, 1] * covariance[1, k]
            P[i, k] = P[k, i] = moved + G[i, 2] * covariance[2, k]
    for i in range(3):
        z[i] = pose[i]
        for k in range(3):
            P[i, k] = covariance[i, k]
    symmetrize(P)


@njit(inner=True)
def decouple(z: Floats, P: Floats, direction: Floats, share: float) -> None:
    """Block-diagonal covariance: what is seen of other directions says nothing about this one.

    ours: remapping the pose alone leaks, as the errors of pose, step, twist and wheels along an
    unobservable `direction` (2,) in the map hang together with those across. P <- share P + (1 -
    share) (A P A + B P B), A the projection on it (and on the wheels' scale), B = 1 - A.
    """
    A = np.zeros((N, N))
    c, s = math.cos(z[2]), math.sin(z[2])
    ux, uy = direction[0], direction[1]
    bx, by = c * ux + s * uy, c * uy - s * ux
    for first in (POSE, STEP, TWIST):
        x, y = (ux, uy) if first == POSE else (bx, by)
        A[first, first], A[first + 1, first + 1] = x * x, y * y
        A[first, first + 1] = A[first + 1, first] = x * y
    A[SCALE, SCALE] = 1.0
    AP = np.zeros((N, N))
    for i in range(N):
        for j in range(N):
            if A[i, j] != 0.0:
                for k in range(N):
                    AP[i, k] += A[i, j] * P[j, k]
    APA = np.zeros((N, N))
    for j in range(N):
        for k in range(N):
            if A[j, k] != 0.0:
                for i in range(N):
                    APA[i, k] += AP[i, j] * A[j, k]
    # A P A + B P B = P - A P - P A + 2 A P A
    for i in range(N):
        for k in range(N):
            split = 2.0 * APA[i, k] - AP[i, k] - AP[k, i]
            P[i, k] += (1.0 - share) * split


@njit(inner=True)
def remap(
    z: Floats, P: Floats, pose: Floats, seen: Floats, direction: Floats, share: float, floor: Floats
) -> None:
    """Take out of a match what noise says along an unobservable direction, in place.

    Solution remapping [Zhang16]: where the scan alone has the pose follows from the fused `pose`
    (3,) and the prior's weight; it is fused again with the information `seen` (3, 3) of which only
    `share` is left along `direction` (2,).
    """
    C, off = P[:3, :3] + np.diag(floor), np.empty(3)
    W = inverse3(C)
    offset_from(z, pose, off)
    w = (FREEDOM + 3.0) / (FREEDOM + mahalanobis(W, off))
    pull, alone, told = np.zeros(3), np.empty(3), np.empty((3, 3))
    for i in range(3):
        for k in range(3):
            pull[i] += w * W[i, k] * off[k]
    inverse = inverse3(seen + WEAKEST * np.eye(3))
    for i in range(3):
        alone[i] = (
            off[i] + inverse[i, 0] * pull[0] + inverse[i, 1] * pull[1] + inverse[i, 2] * pull[2]
        )
    D = np.eye(3)
    for i in range(2):
        for k in range(2):
            D[i, k] += (math.sqrt(share) - 1.0) * direction[i] * direction[k]
    for i in range(3):
        for k in range(3):
            total = 0.0
            for j in range(3):
                for m in range(3):
                    total += D[i, j] * seen[j, m] * D[m, k]
            told[i, k] = total
    both = inverse3(told + w * W)
    for i in range(3):
        for k in range(3):
            seen[i, k] = told[i, k]
        pull[i] = told[i, 0] * alone[0] + told[i, 1] * alone[1] + told[i, 2] * alone[2]
    for i in range(3):
        moved = both[i, 0] * pull[0] + both[i, 1] * pull[1] + both[i, 2] * pull[2]
        pose[i] = z[i] + moved
    pose[2] = wrap_angle(pose[2])


@njit(inner=True, borrows=True)
def learn_density(
    change: Floats, variance: Floats, P: Floats, share: float, usual: Floats, density: Floats
) -> None:
    """Acceleration density (3,) by the changes (3,) of the twist that matches make.

    [SageHusa69], in logarithms: squared change over the variance that the match removed, of a mean
    of 1. `variance` (3,) of the twist before the match; at most `SPREAD` times the `usual` (3,).
    """
    for i in range(3):
        removed = variance[i] - P[TWIST + i, TWIST + i]
        if removed < SLOWEST * variance[i] or removed <= 0.0:
            continue
        surprise = min(change[i] * change[i] / removed - 1.0, SHARPEST)
        found = density[i] * math.exp(share * surprise)
        density[i] = min(max(found, usual[i] / SPREAD), usual[i] * SPREAD)


@njit(inner=True, borrows=True)
def judge_readings(
    z: Floats, step: Floats, dt: float, share: float, floor: Floats, readings: Floats, trust: Floats
) -> None:
    """Factors (4,) of the readings' variances, by the step (3,) between the matched poses.

    ours: innovation-based adaptive estimation [Mohamed99]: the mean squared residual over its
    variance, never below 1, as wheels that are exact on one floor are not on the next.
    """
    for i in range(4):
        if readings[i, VALID] == 0.0:
            continue
        if i == GYRO:
            expected, error = step[2] + dt * z[BIAS], floor[2]
        elif i == 1:
            expected, error = step[1], floor[1]
        else:
            scale = z[SCALE + (1 if i == 2 else 0)]
            expected, error = (1.0 + scale) * step[i], floor[i]
        off = readings[i, VALUE] - expected
        ratio = off * off / (readings[i, VARIANCE] + 2.0 * error)
        trust[i] += share * (min(max(ratio, 1.0), 1e4) - trust[i])


@njit
def update(
    z: Floats,
    P: Floats,
    match: Floats,
    how: Floats,
    before: Floats,
    learned: Floats,
    usual: Floats,
    readings: Floats,
) -> None:
    """Condition the state on a match: limit its information, fuse, regress, learn.

    match (4, 3): pose; information of the scan about it. how (3, 3): unobservable direction and the
    share observed along it; dt, shares to learn accelerations and readings by; variances of the
    map's error. before (3,): the last scan's pose.
    """
    pose, seen, direction, share = match[0], match[1:], how[0, :2], how[0, 2]
    dt, floor = how[1, 0], how[2]
    if share < 1.0:
        decouple(z, P, direction, share)
        remap(z, P, pose, seen, direction, share, floor)
    off, step, change = np.empty(3), np.empty(3), np.empty(3)
    variance, covariance = np.empty(3), np.empty((3, 3))
    for i in range(3):
        change[i], variance[i] = z[TWIST + i], P[TWIST + i, TWIST + i]
    offset_from(z, pose, off)
    nis = mahalanobis(inverse3(P[:3, :3] + np.diag(floor)), off)
    widen = (FREEDOM + nis) / (FREEDOM + 3.0)
    if widen > 1.0:  # [Roth13]: a match that surprises says that the prior was too sure
        scale_rows(P, POSE, SCALE, math.sqrt(widen))
    alone = inverse3(seen + WEAKEST * np.eye(3)) + np.diag(floor)
    covariance[:, :] = inverse3(inverse3(alone) + inverse3(P[:3, :3]))
    condition(z, P, pose, covariance)
    for i in range(3):
        change[i] = z[TWIST + i] - change[i]
    learn_density(change, variance, P, how[1, 1], usual, learned[0])
    between_halfway(before, pose, step)
    judge_readings(z, step, dt, how[1, 2], floor, readings, learned[1])


@njit(inner=True, borrows=True)
def between_halfway(before: Floats, pose: Floats, out: Floats) -> None:
    """The step (3,) from one pose to another, seen from the heading half way. ours."""
    dx, dy, turn = pose[0] - before[0], pose[1] - before[1], wrap_angle(pose[2] - before[2])
    half = before[2] + 0.5 * turn
    c, s = math.cos(half), math.sin(half)
    out[0], out[1], out[2] = c * dx + s * dy, c * dy - s * dx, turn
