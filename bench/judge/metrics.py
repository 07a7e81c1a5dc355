"""Pose errors: pure functions on poses (n, 3) of x, y [m], theta [rad]."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.metrics import Indices, between, driven, from_first, pair_errors, pairs_over_time
from slams.types import Floats, wrap_angle

if TYPE_CHECKING:
    from slams.scanlog import ScanLog

TRANSLATION_CLASS_WIDTH = 0.025  # m, [Kuehn] Fig. 2
ORIENTATION_CLASS_WIDTH = 0.05  # rad, [Kuehn] Fig. 3
MAX_STAMP_DIFFERENCE = 5e-4  # s, of a relation from a scan
MIN_LOOP_TIME = 20.0  # s between the stamps of a relation that closes a loop
# update rates differ between programs; errors over times and distances can be compared
TIME_SPANS = {"update": 0.0, "0.1 s": 0.1, "1 s": 1.0, "10 s": 10.0}  # s
PATH_SPANS = {"1 m": 1.0}  # m of the true path
SPANS = (*TIME_SPANS, *PATH_SPANS)


class Common(NamedTuple):
    """Poses with ground truth, both trajectories (n, 3) in the frame of their first pose.

    `t` (n,) [s]; `dropped` poses lie outside the ground truth, which is never extrapolated.
    """

    t: Floats
    estimate: Floats
    truth: Floats
    dropped: int


class SpanErrors(NamedTuple):
    """Errors of the motion over one span, one value per pair of poses, (k,) each.

    `t` [s] is the stamp of the pair's second pose. `translation` [m] and `orientation` [rad] are
    the paper's differences of components in the common frame, `se2_translation` [m] is the error of
    the relative motion. The orientation error is the same for both.
    """

    t: Floats
    translation: Floats
    orientation: Floats
    se2_translation: Floats


def common(t: Floats, estimate: Floats, truth: Floats) -> Common:
    """Align both frames at the first pose with ground truth; truth (n, 3) is nan where missing."""
    covered = ~np.isnan(truth[:, 0])
    dropped = len(t) - int(covered.sum())
    if dropped == len(t):
        return Common(t[:0], estimate[:0], truth[:0], dropped)
    return Common(t[covered], from_first(estimate[covered]), from_first(truth[covered]), dropped)


def common_with(log: ScanLog, t: Floats, estimate: Floats) -> Common | None:
    """Poses (n, 3) at stamps (n,) with the log's ground truth; None for fewer than two poses."""
    truth = log.truth_at(t)
    found = None if truth is None else common(t, estimate, truth)
    return None if found is None or len(found.t) < 2 else found


def component_errors(
    estimate: Floats, truth: Floats, first: Indices, second: Indices
) -> tuple[Floats, Floats]:
    """[Kuehn] eq. 1-3: eps = |dg - dp| with dp = p[first] - p[second] and dg likewise.

    Translation (k,) [m] and orientation (k,) [rad] in the common frame.
    """
    dp, dg = estimate[first] - estimate[second], truth[first] - truth[second]
    translation: Floats = np.hypot(dg[:, 0] - dp[:, 0], dg[:, 1] - dp[:, 1])
    return translation, np.abs(wrap_angle(dg[:, 2] - dp[:, 2]))


def pairs_over_path(poses: Floats, distance: float) -> tuple[Indices, Indices]:
    """Indices (k,), (k,) of each pose and the first pose at least `distance` [m] later."""
    length = driven(poses)
    partner = np.searchsorted(length, length + distance)
    found = np.flatnonzero(partner < len(poses))
    return found, partner[found]


def span_errors(common: Common, span: str) -> SpanErrors | None:
    """All errors over one of `SPANS`; None if no two poses are so far apart."""
    if span in PATH_SPANS:
        first, second = pairs_over_path(common.truth, PATH_SPANS[span])
    else:
        first, second = pairs_over_time(common.t, TIME_SPANS[span])
    if not len(first):
        return None
    paper = component_errors(common.estimate, common.truth, first, second)
    se2, _ = pair_errors(common.estimate, common.truth, first, second)
    return SpanErrors(common.t[second], *paper, se2)


def errors_over_spans(common: Common) -> dict[str, SpanErrors]:
    """The errors over each of `SPANS`, by its name, if the poses have it."""
    found = {span: span_errors(common, span) for span in SPANS}
    return {name: errors for name, errors in found.items() if errors is not None}


class RelationErrors(NamedTuple):
    """Errors (k,) [m], [rad] of the relations used, out of `given` ones; `loop`: loop closures."""

    t: Floats
    translation: Floats
    rotation: Floats
    loop: NDArray[np.bool_]
    given: int


def relation_errors(t: Floats, poses: Floats, relations: Floats) -> RelationErrors:
    """[Kuemmerle09]: error of each relation, inverse(relation) @ (inverse(pose t1) @ pose t2).

    Args:
        t: stamps (n,) [s]; they may jump back.
        poses: poses (n, 3) at the stamps.
        relations: rows t1 t2 x y theta (k, 5); those at other stamps are left out.
    """
    first, found_first = _nearest(t, relations[:, 0])
    second, found_second = _nearest(t, relations[:, 1])
    used = np.logical_and(found_first, found_second)
    moved = between(poses[first[used]], poses[second[used]])
    error = between(relations[used, 2:5], moved)
    stamps = relations[used, :2]
    return RelationErrors(
        stamps.max(axis=1),
        np.hypot(error[:, 0], error[:, 1]),
        np.abs(error[:, 2]),
        np.abs(stamps[:, 1] - stamps[:, 0]) > MIN_LOOP_TIME,
        len(relations),
    )


def class_shares(values: Floats, width: float, classes: int) -> Floats:
    """Share of the values in each class [k width, (k + 1) width); larger ones in the last."""
    index = np.minimum(np.floor(values / width).astype(np.int64), classes - 1)
    shares: Floats = np.bincount(index, minlength=classes) / max(len(values), 1)
    return shares


def _nearest(t: Floats, wanted: Floats) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    order: NDArray[np.int64] = np.argsort(t, kind="stable")
    ordered = t[order]
    right = np.clip(np.searchsorted(ordered, wanted), 1, max(len(t) - 1, 1))
    left = right - 1
    right = np.minimum(right, len(t) - 1)
    nearer = np.where(
        np.abs(ordered[left] - wanted) <= np.abs(ordered[right] - wanted), left, right
    )
    return order[nearer], np.abs(ordered[nearer] - wanted) <= MAX_STAMP_DIFFERENCE
