"""Kernels of the motion filter: condition the state on a match, and learn from it.

State and covariance as in `filter_kernels`, which has the papers, too.

[Mohamed99] A. Mohamed, K. Schwarz: Adaptive Kalman filtering for INS/GPS. J. Geodesy 73, 1999.
"""

from __future__ import annotations

import math

import numpy as np

from slams.frontend.filter_kernels import (
    BIAS,
    DRIFT,
    GYRO,
    ITS_VARIANCE,
    LARGEST,
    POSE,
    RESIDUAL,
    SCALE,
    STEP,
    TWIST,
    VALID,
    VALUE,
    VARIANCE,
    N,
    scale_rows,
    symmetrize,
)
from slams.geometry import STUDENT_DOF, inverse3, mahalanobis_squared, wrap_angle
from slams.jit import njit
from slams.types import Floats, Pose2

WEAKEST = 1e-2  # 1/m^2, 1/rad^2: information added where a match has none
LATENCY = 0.5  # s that a recorder keeps a scan back
SHARPEST = 10.0  # NIS of one match that counts at most, in what is learned
SLOWEST = 0.1  # least share of a twist's variance that a match has to remove, to be learned from
TAKEN_IN = 0.5  # share of a match's noise that enters the map; earlier scans average the rest
SPREAD = 20.0  # times the usual acceleration density, at most and at least


@njit(inner=True, borrows=True)
def offset_from(z: Floats, pose: Floats, out: Floats) -> None:
    """Difference of a pose (3,) from the state's. ours."""
    out[0], out[1] = pose[0] - z[0], pose[1] - z[1]
    out[2] = wrap_angle(pose[2] - z[2])


@njit(inner=True, borrows=True)
def both_sides(A: Floats, B: Floats, out: Floats) -> None:
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
    z: Floats,
    P: Floats,
    pose: Floats,
    seen: Floats,
    direction: Floats,
    share: float,
    prior: Floats,
) -> None:
    """Take out of a match what noise says along an unobservable direction, in place.

    Solution remapping [Zhang16]: where the scan alone has the pose follows from the fused `pose`
    (3,) and the prior's weight, of P and the variances `prior` (3,); it is fused again with the
    information `seen` (3, 3) of which only `share` is left along `direction` (2,).
    """
    C, off = P[:3, :3] + np.diag(prior), np.empty(3)
    W = inverse3(C)
    offset_from(z, pose, off)
    w = (STUDENT_DOF + 3.0) / (STUDENT_DOF + mahalanobis_squared(W, Pose2(off[0], off[1], off[2])))
    pull, alone, weighted = np.zeros(3), np.empty(3), np.empty((3, 3))
    for i in range(3):
        for k in range(3):
            pull[i] += w * W[i, k] * off[k]
    inverse = inverse3(seen + W)  # of `seen` alone what it does not observe would be amplified
    for i in range(3):
        alone[i] = (
            off[i] + inverse[i, 0] * pull[0] + inverse[i, 1] * pull[1] + inverse[i, 2] * pull[2]
        )
    D = np.eye(3)
    for i in range(2):
        for k in range(2):
            D[i, k] += (math.sqrt(share) - 1.0) * direction[i] * direction[k]
    both_sides(D, seen, weighted)
    both = inverse3(weighted + w * W)
    for i in range(3):
        for k in range(3):
            seen[i, k] = weighted[i, k]
        pull[i] = weighted[i, 0] * alone[0] + weighted[i, 1] * alone[1] + weighted[i, 2] * alone[2]
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
    variance, never below 1, as wheels that are exact on one floor are not on the next. Of the last
    step, the one before and both together the best counts where scans come that fast: one that a
    recorder kept back makes two steps wrong, but not their sum.
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
            expected += z[DRIFT] * step[0] if i == 2 else 0.0
        off, variance = readings[i, VALUE] - expected, readings[i, VARIANCE] + 2.0 * error
        before, of_before = readings[i, RESIDUAL], readings[i, ITS_VARIANCE]
        readings[i, RESIDUAL], readings[i, ITS_VARIANCE] = off, variance
        ratio = off * off / variance
        if of_before > 0.0 and dt < LATENCY:
            both = (off + before) * (off + before) / (variance + of_before)
            ratio = min(ratio, before * before / of_before, both)
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
    """Condition the state on a match: limit its information, fuse, regress, learn. ours.

    match (4, 3): pose, remapped in place; information of the scan about it, in whose place the part
    of the match's noise K R K^T is left that enters the map. how (4, 3): unobservable direction and
    the share observed along it; dt, shares to learn accelerations and readings by; variances of the
    match that no scan removes; those beside P in its prior. before (3,): the last scan's pose.
    """
    pose, seen, direction, share = match[0], match[1:], how[0, :2], how[0, 2]
    dt, floor, beside = how[1, 0], how[2], how[3]
    if share < 1.0:
        decouple(z, P, direction, share)
        remap(z, P, pose, seen, direction, share, beside)
    off, step, change, state = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    variance, covariance = np.empty(3), np.empty((3, 3))
    for i in range(3):
        change[i], variance[i] = z[TWIST + i], P[TWIST + i, TWIST + i]
    offset_from(z, pose, off)
    nis = mahalanobis_squared(inverse3(P[:3, :3] + np.diag(beside)), Pose2(off[0], off[1], off[2]))
    widen = (STUDENT_DOF + min(nis, LARGEST)) / (STUDENT_DOF + 3.0)
    if widen > 1.0:  # [Roth13]: a match that surprises says that the prior was too sure
        scale_rows(P, POSE, SCALE, math.sqrt(widen))
    information = inverse3(inverse3(seen + WEAKEST * np.eye(3)) + np.diag(floor))
    covariance[:, :] = inverse3(information + inverse3(P[:3, :3]))
    both_sides(covariance, information, seen)
    seen *= TAKEN_IN
    toward_stamp(z, P, pose, floor, state)
    condition(z, P, state, covariance)
    for i in range(3):
        change[i] = z[TWIST + i] - change[i]
    learn_density(change, variance, P, how[1, 1], usual, learned[0])
    between_halfway(before, z[:3], step)
    judge_readings(z, step, dt, how[1, 2], floor, readings, learned[1])


@njit(inner=True)
def toward_stamp(z: Floats, P: Floats, pose: Floats, floor: Floats, out: Floats) -> None:
    """The state's pose (3,) by a match that errs by `floor` (3,), its stamp's error above all.

    ours: of the matched difference P (P + floor)^-1 is the robot's, the rest is the scan's.
    """
    off, share = np.empty(3), inverse3(P[:3, :3] + np.diag(floor))
    offset_from(z, pose, off)
    for i in range(3):
        out[i] = z[i]
        for k in range(3):
            out[i] += P[i, k] * (share[k, 0] * off[0] + share[k, 1] * off[1] + share[k, 2] * off[2])
    out[2] = wrap_angle(out[2])


@njit(inner=True, borrows=True)
def between_halfway(before: Floats, pose: Floats, out: Floats) -> None:
    """The step (3,) from one pose to another, seen from the heading half way. ours."""
    dx, dy, turn = pose[0] - before[0], pose[1] - before[1], wrap_angle(pose[2] - before[2])
    half = before[2] + 0.5 * turn
    c, s = math.cos(half), math.sin(half)
    out[0], out[1], out[2] = c * dx + s * dy, c * dy - s * dx, turn
