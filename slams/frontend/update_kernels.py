"""Kernels of the motion filter: condition the state on a match, and learn the noise from it.

State and covariance as in `filter_kernels`.

[Mohamed99] A. Mohamed, K. Schwarz: Adaptive Kalman filtering for INS/GPS. J. Geodesy 73, 1999.
[Roth13] M. Roth, E. Ozkan, F. Gustafsson: A Student's t filter for heavy tailed process and
measurement noise. ICASSP 2013.
[SageHusa69] A. Sage, G. Husa: Adaptive filtering with unknown prior statistics. JACC 1969.
[Zhang16] J. Zhang, M. Kaess, S. Singh: On Degeneracy of Optimization-based State Estimation
Problems. ICRA 2016.
"""

from __future__ import annotations

import math

import numpy as np

from slams.frontend.filter_kernels import (
    GYRO,
    LAST_RESIDUAL,
    LAST_VARIANCE,
    MAX_NIS,
    POSE,
    PRIOR_STD,
    RATE_CHANGE,
    SCALE,
    STEP,
    TWIST,
    VALID,
    VALUE,
    VARIANCE,
    N,
    expected_value,
    scale_rows,
    symmetrize,
)
from slams.frontend.step_kernels import is_jump, isolate, midpoint_step
from slams.frontend.timing import MIN_LASER_OFFSET
from slams.geometry import STUDENT_DOF, inverse3, mahalanobis_squared, wrap_angle
from slams.jit import njit
from slams.types import Floats, Pose2

MAX_SCAN_DELAY = 0.5  # s that a recorder may hold a scan back
MAX_LEARNED_NIS = 10.0  # of a match, so that one outlier changes little of what is learned
MIN_VARIANCE_REDUCTION = 0.1  # of the twist by a match; below it nothing is learned from the match
MAP_NOISE_SHARE = 0.5  # of a match's covariance that stays in the map; earlier scans average it
MAX_DENSITY_RATIO = 20.0  # of the learned acceleration density to the default, up and down


@njit(inner=True, borrows=True)
def offset_from(z: Floats, pose: Floats, out: Floats) -> None:
    """Difference (3,) of a pose (3,) from the state's pose. ours."""
    out[0], out[1] = pose[0] - z[0], pose[1] - z[1]
    out[2] = wrap_angle(pose[2] - z[2])


@njit(inner=True, borrows=True)
def sandwich(A: Floats, B: Floats, out: Floats) -> None:
    """The product A B A of a symmetric A (3, 3) with B (3, 3). ours."""
    for i in range(3):
        for k in range(3):
            total = 0.0
            for j in range(3):
                for m in range(3):
                    total += A[i, j] * B[j, m] * A[m, k]
            out[i, k] = total


@njit(inner=True)
def condition(z: Floats, P: Floats, pose: Floats, covariance: Floats) -> None:
    """Replace the distribution of the pose by `pose` with `covariance`; regress all other states.

    ours: z += G d, P <- P - G P_pp G^T + G C G^T with G = P[:, :3] P_pp^-1 and the difference d. It
    fits any posterior of the pose that has a mean and a covariance, also a particle cloud.
    """
    inverse = inverse3(P[:3, :3])
    G, d, change = np.empty((N, 3)), np.empty(3), np.empty((3, 3))
    offset_from(z, pose, d)
    for i in range(N):
        for k in range(3):
            G[i, k] = P[i, 0] * inverse[0, k] + P[i, 1] * inverse[1, k] + P[i, 2] * inverse[2, k]
    for i in range(3):
        for k in range(3):
            change[i, k] = covariance[i, k] - P[i, k]
    for i in range(3, N):
        z[i] += G[i, 0] * d[0] + G[i, 1] * d[1] + G[i, 2] * d[2]
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
    """Remove the correlation of the state along a degenerate direction with the state across it.

    ours: remapping the pose alone is not enough, since pose, step, twist and wheel scale along the
    `direction` (2,) in the map are correlated with those across. P <- share P + (1 - share)
    (A P A + B P B), A the projection on the direction and the wheel scale, B = 1 - A.
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
    # A P A + B P B = P - A P - P A + 2 A P A
    for i in range(N):
        for k in range(N):
            APA = 0.0
            for j in range(N):
                APA += AP[i, j] * A[j, k]
            P[i, k] += (1.0 - share) * (2.0 * APA - AP[i, k] - AP[k, i])


@njit(inner=True)
def remap(
    z: Floats,
    P: Floats,
    pose: Floats,
    information: Floats,
    direction: Floats,
    share: float,
    prior: Floats,
) -> None:
    """Solution remapping [Zhang16]: remove the noise of a match along a degenerate direction.

    ours: the fused `pose` (3,) and the weight of the prior, P plus the variances `prior` (3,), give
    the scan-only estimate x. It is fused again with the `information` (3, 3) of the scan, of which
    only `share` remains along `direction` (2,). `pose` and `information` change in place.
    """
    W, d = inverse3(P[:3, :3] + np.diag(prior)), np.empty(3)
    offset_from(z, pose, d)
    w = (STUDENT_DOF + 3.0) / (STUDENT_DOF + mahalanobis_squared(W, Pose2(d[0], d[1], d[2])))
    pull, x, weighted = np.zeros(3), np.empty(3), np.empty((3, 3))
    for i in range(3):
        for k in range(3):
            pull[i] += w * W[i, k] * d[k]
    inverse = inverse3(information + W)  # the scan's alone would amplify unobserved directions
    for i in range(3):
        x[i] = d[i] + inverse[i, 0] * pull[0] + inverse[i, 1] * pull[1] + inverse[i, 2] * pull[2]
    D = np.eye(3)
    for i in range(2):
        for k in range(2):
            D[i, k] += (math.sqrt(share) - 1.0) * direction[i] * direction[k]
    sandwich(D, information, weighted)
    S = inverse3(weighted + w * W)
    for i in range(3):
        for k in range(3):
            information[i, k] = weighted[i, k]
        pull[i] = weighted[i, 0] * x[0] + weighted[i, 1] * x[1] + weighted[i, 2] * x[2]
    for i in range(3):
        pose[i] = z[i] + (S[i, 0] * pull[0] + S[i, 1] * pull[1] + S[i, 2] * pull[2])
    pose[2] = wrap_angle(pose[2])


@njit(inner=True, borrows=True)
def learn_density(
    change: Floats, variance: Floats, P: Floats, share: float, default: Floats, density: Floats
) -> None:
    """Learn the acceleration density (3,) from the change (3,) of the twist by a match, in place.

    [SageHusa69], in logarithms: the mean of the squared change over the variance that the match
    removed is 1. `variance` (3,) of the twist before; `share`: learning rate; `default` density.
    """
    for i in range(3):
        removed = variance[i] - P[TWIST + i, TWIST + i]
        if removed < MIN_VARIANCE_REDUCTION * variance[i]:
            continue
        excess = min(change[i] * change[i] / removed - 1.0, MAX_LEARNED_NIS)
        learned = max(density[i] * math.exp(share * excess), default[i] / MAX_DENSITY_RATIO)
        density[i] = min(learned, default[i] * MAX_DENSITY_RATIO)


@njit(inner=True, borrows=True)
def learn_factors(
    z: Floats, step: Floats, dt: float, share: float, floor: Floats, readings: Floats, out: Floats
) -> None:
    """Learn the variance factors (4,) of the readings from the step (3,) between matched poses.

    [Mohamed99]: the mean of the squared residual over its variance. ours: never below 1, as wheels
    may slip on the next floor. A scan that was held back makes two steps wrong, but not their sum:
    if scans come fast, the least ratio of the last step, the step before and the sum counts.
    """
    for i in range(4):
        if readings[i, VALID] == 0.0:
            continue
        axis = 2 if i == GYRO else i
        change = readings[i, RATE_CHANGE]
        residual = readings[i, VALUE] - expected_value(z, i, step[axis], step[0], dt, change)
        variance = readings[i, VARIANCE] + 2.0 * floor[axis]
        last, last_variance = readings[i, LAST_RESIDUAL], readings[i, LAST_VARIANCE]
        readings[i, LAST_RESIDUAL], readings[i, LAST_VARIANCE] = residual, variance
        ratio = residual * residual / variance
        if last_variance > 0.0 and dt < MAX_SCAN_DELAY:
            both = (residual + last) * (residual + last) / (variance + last_variance)
            ratio = min(ratio, last * last / last_variance, both)
        out[i] += share * (min(max(ratio, 1.0), 1e4) - out[i])


@njit
def update(
    z: Floats,
    P: Floats,
    match: tuple[tuple[float, ...], Floats],
    how: tuple[tuple[float, ...], tuple[float, ...]],
    floor: Floats,
    last: tuple[Floats, Floats],
    learning: tuple[Floats, Floats],
    readings: Floats,
) -> tuple[float, float, float]:
    """Condition the state on a match: remap, fuse, regress, learn, in place; the pose remapped.

    match: pose, scan fused with prior; information (3, 3) of the scan about it, which is replaced
    by the covariance K R K^T that the match adds to the map. how: degenerate direction and share
    observed along it; dt, learning rates of accelerations and of readings. floor (3,): variances of
    a match; last: pose (3,) of the last scan, rate (3,) of the step to it; learning: `learned` of
    `predict`, default densities. ours: a jump moves the pose alone; [Roth13], a match with a large
    NIS inflates the covariance of the prior.
    """
    fused, information = match
    (along_x, along_y, share), (dt, density_rate, factor_rate) = how
    (learned, default), (last_pose, last_rate) = learning, last
    direction, pose, prior = np.array((along_x, along_y)), np.array(fused), np.empty(3)
    for i in range(3):
        prior[i] = floor[i] + PRIOR_STD[i] ** 2
    if share < 1.0:
        decouple(z, P, direction, share)
        remap(z, P, pose, information, direction, share, prior)
    d, step, state = np.empty(3), np.empty(3), np.empty(3)
    twist, variance = z[TWIST:SCALE].copy(), np.diag(P)[TWIST:SCALE].copy()
    midpoint_step(last_pose, pose, step)
    if is_jump(step, dt, last_rate):
        isolate(P, POSE)
    if dt > MIN_LASER_OFFSET:
        last_rate[:] = step / dt
    offset_from(z, pose, d)
    nis = mahalanobis_squared(inverse3(P[:3, :3] + np.diag(prior)), Pose2(d[0], d[1], d[2]))
    factor = (STUDENT_DOF + min(nis, MAX_NIS)) / (STUDENT_DOF + 3.0)
    if factor > 1.0:
        scale_rows(P, POSE, SCALE, math.sqrt(factor))
    # 1e-2 /m^2, /rad^2 make the information of a degenerate match invertible
    limited = inverse3(inverse3(information + 1e-2 * np.eye(3)) + np.diag(floor))
    posterior = inverse3(limited + inverse3(P[:3, :3]))
    sandwich(posterior, limited, information)
    information *= MAP_NOISE_SHARE
    pose_at_stamp(z, P, pose, floor, state)
    condition(z, P, state, posterior)
    learn_density(z[TWIST:SCALE] - twist, variance, P, density_rate, default, learned[0])
    midpoint_step(last_pose, z[:3], step)
    learn_factors(z, step, dt, factor_rate, floor, readings, learned[1])
    return pose[0], pose[1], pose[2]


@njit(inner=True)
def pose_at_stamp(z: Floats, P: Floats, pose: Floats, floor: Floats, out: Floats) -> None:
    """Pose (3,) of the state by a match with noise floor (3,), above all the error of its stamp.

    ours: P (P + floor)^-1 of the difference is the robot's, the rest is the error of the stamp.
    """
    d, W = np.empty(3), inverse3(P[:3, :3] + np.diag(floor))
    offset_from(z, pose, d)
    for i in range(3):
        out[i] = z[i]
        for k in range(3):
            out[i] += P[i, k] * (W[k, 0] * d[0] + W[k, 1] * d[1] + W[k, 2] * d[2])
    out[2] = wrap_angle(out[2])
