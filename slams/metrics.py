"""Errors of a trajectory against the truth: pure functions on arrays of poses (n, 3).

A pose is x, y [m], theta [rad]. Errors of translation and rotation are separate.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats, Pose2, wrap_angle

Indices = NDArray[np.int64]


def between(a: Floats, b: Floats) -> Floats:
    """Poses b (n, 3) in the frames of poses a (n, 3): inverse(a) @ b."""
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    d = b - a
    columns = (c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], wrap_angle(d[:, 2]))
    return np.stack(columns, axis=1)


def from_first(poses: Floats) -> Floats:
    """Poses (n, 3) in the frame of the first pose."""
    return between(np.repeat(poses[:1], len(poses), axis=0), poses)


def pair_errors(
    estimate: Floats, truth: Floats, first: Indices, second: Indices
) -> tuple[Floats, Floats]:
    """Error of the motion from pose `first` to pose `second`, in the body frame [Kuemmerle09].

    inverse(true motion) @ estimated motion: its distance (k,) [m] and rotation (k,) [rad]. The
    trajectories need no common frame.
    """
    moved = between(estimate[first], estimate[second])
    true = between(truth[first], truth[second])
    error = between(true, moved)
    return np.hypot(error[:, 0], error[:, 1]), np.abs(error[:, 2])


def pairs_over_time(t: Floats, span: float) -> tuple[Indices, Indices]:
    """Indices (k,), (k,) of pairs of poses that are `span` seconds apart.

    The partner of a pose is the pose with the nearest stamp. It may miss the span by half the
    median interval and by a quarter of the span: a log of 5 Hz has no pairs 0.1 s apart. Stamps may
    jump back. A span of 0 pairs each pose with the next one.
    """
    if not span:
        first = np.arange(max(len(t) - 1, 0))
        return first, first + 1
    order = np.argsort(t, kind="stable")
    ordered = t[order]
    step = float(np.median(np.diff(ordered))) if len(t) > 1 else 0.0
    tolerance = min(0.25 * span, 0.51 * step)
    last = len(t) - 1
    right = np.clip(np.searchsorted(ordered, ordered + span), min(1, last), last)
    left = np.maximum(right - 1, 0)
    miss_left = np.abs(ordered[left] - ordered - span)
    miss_right = np.abs(ordered[right] - ordered - span)
    partner = np.where(miss_left < miss_right, left, right)
    found = np.minimum(miss_left, miss_right) <= tolerance
    return order[found], order[partner[found]]


def align(estimate: Floats, truth: Floats) -> Pose2:
    """The rigid motion that fits the estimated positions to the true ones best (Umeyama)."""
    p, q = estimate[:, :2], truth[:, :2]
    mean_p, mean_q = p.mean(axis=0), q.mean(axis=0)
    dp, dq = p - mean_p, q - mean_q
    cross = float((dp[:, 0] * dq[:, 1] - dp[:, 1] * dq[:, 0]).sum())
    theta = math.atan2(cross, float((dp * dq).sum()))
    turned = Pose2(0.0, 0.0, theta).transform(mean_p[None, :])[0]
    return Pose2(float(mean_q[0] - turned[0]), float(mean_q[1] - turned[1]), theta)


def ate(estimate: Floats, truth: Floats) -> float:
    """Absolute trajectory error: root mean square of the distances after `align` [m]."""
    moved = align(estimate, truth).transform(estimate[:, :2])
    return float(np.sqrt(np.mean(np.hypot(*(moved - truth[:, :2]).T) ** 2)))


def driven(poses: Floats) -> Floats:
    """Path length (n,) [m] through the positions up to each pose."""
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)])


def path_length(poses: Floats) -> float:
    """Length of the path through the positions [m]."""
    return float(driven(poses)[-1])
