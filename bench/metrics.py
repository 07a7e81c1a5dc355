"""The errors the benchmark reports: pure functions on poses (n, 3) of x, y [m], theta [rad]."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.metrics import between, from_first, relative_errors
from slams.types import Floats, wrap_angle

TRANSLATION_CLASS = 0.025  # m, [Kuehn] Fig. 2
ORIENTATION_CLASS = 0.05  # rad, [Kuehn] Fig. 3


class UpdateErrors(NamedTuple):
    """Errors of each pose update, from the second pose on: stamps [s], [m], [rad], [m], [rad].

    `translation` and `orientation` are the paper's; `se2_translation` and `se2_rotation` those of
    the relative motion in the body frame. `dropped` updates lie outside the truth.
    """

    t: Floats
    translation: Floats
    orientation: Floats
    se2_translation: Floats
    se2_rotation: Floats
    dropped: int


def component_errors(estimate: Floats, truth: Floats) -> tuple[Floats, Floats]:
    """[Kuehn] eq. 1-3: eps = |dg - dp| with dp = p[t-1] - p[t] and dg likewise, in the map frame.

    Translation (n - 1,) [m] and orientation (n - 1,) [rad] apart. Both trajectories must be given
    in one frame.
    """
    dp, dg = estimate[:-1] - estimate[1:], truth[:-1] - truth[1:]
    translation: Floats = np.hypot(dg[:, 0] - dp[:, 0], dg[:, 1] - dp[:, 1])
    return translation, np.abs(wrap_angle(dg[:, 2] - dp[:, 2]))


def update_errors(t: Floats, estimate: Floats, truth: Floats) -> UpdateErrors:
    """All per-update errors of an estimate (n, 3) against the truth at its stamps, nan = none.

    The frames are made common by the first pose that has a truth: both trajectories are seen from
    it. Updates without a truth at either end are dropped and counted.
    """
    covered = ~np.isnan(truth[:, 0])
    dropped = len(t) - int(covered.sum())
    t, estimate, truth = t[covered], estimate[covered], truth[covered]
    if len(t) < 2:
        none = np.zeros(0)
        return UpdateErrors(none, none, none, none, none, dropped)
    paper = component_errors(from_first(estimate), from_first(truth))
    return UpdateErrors(t[1:], *paper, *relative_errors(estimate, truth, 1), dropped)


def relation_errors(
    t: Floats, poses: Floats, relations: Floats, tolerance: float = 5e-4
) -> tuple[Floats, Floats, int]:
    """[Kuemmerle09]: error of each relation, inverse(relation) @ (inverse(pose t1) @ pose t2).

    Args:
        t: stamps (n,) [s]; they may jump back.
        poses: poses (n, 3) at the stamps.
        relations: rows t1 t2 x y theta (k, 5).
        tolerance: how far a stamp may be from a relation's [s].

    Returns:
        Lengths [m] and turns [rad] of the errors, and how many relations had both stamps.
    """
    first, found_first = _nearest(t, relations[:, 0], tolerance)
    second, found_second = _nearest(t, relations[:, 1], tolerance)
    used = np.logical_and(found_first, found_second)
    moved = between(poses[first[used]], poses[second[used]])
    error = between(relations[used, 2:5], moved)
    return np.hypot(error[:, 0], error[:, 1]), np.abs(error[:, 2]), int(used.sum())


def class_shares(values: Floats, width: float, classes: int) -> Floats:
    """Share of the values in each class [k width, (k + 1) width); the last also holds the rest."""
    index = np.minimum(np.floor(values / width).astype(np.int64), classes - 1)
    shares: Floats = np.bincount(index, minlength=classes) / max(len(values), 1)
    return shares


def _nearest(
    t: Floats, wanted: Floats, tolerance: float
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    order: NDArray[np.int64] = np.argsort(t, kind="stable")
    ordered = t[order]
    right = np.clip(np.searchsorted(ordered, wanted), 1, max(len(t) - 1, 1))
    left = right - 1
    right = np.minimum(right, len(t) - 1)
    nearer = np.where(
        np.abs(ordered[left] - wanted) <= np.abs(ordered[right] - wanted), left, right
    )
    return order[nearer], np.abs(ordered[nearer] - wanted) <= tolerance
