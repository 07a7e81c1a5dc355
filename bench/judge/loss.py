"""Failure is a result: whether a run lost its way, when, and how far it had come."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.judge.metrics import Common, RelationErrors
from slams.metrics import driven
from slams.types import Floats, wrap_angle

LIMIT_M = 0.5  # a pose further off than this and LIMIT_SHARE of the distance driven is lost
LIMIT_SHARE = 0.05  # drift that map and robot can live with
LIMIT_RAD = 0.3
POSES_OF_A_RELATION = 2.0  # each may be off by the limits, the relation by both together
BROKEN_SHARE = 0.05  # of the relations that may be off by more
REPORTED_SHARE = 0.05  # of the scans that the algorithm itself may call lost


def by_truth(common: Common) -> dict[str, Any]:
    """When the pose first was further off than the limits, and for which share it was not.

    `at_s` from the log's first truth on and `after_m` of the true way; None if it never was.
    `completed` is the share of the poses within the limits: one that was lost may come back.
    """
    return _verdict(limits_exceeded(common), common.t - common.t.min(), driven(common.truth))


def limits_exceeded(common: Common) -> NDArray[np.bool_]:
    """Where (n,) the pose is off by more than the limits, in the frame of the first pose."""
    off = np.hypot(*(common.estimate - common.truth)[:, :2].T)
    turned = np.abs(wrap_angle(common.estimate[:, 2] - common.truth[:, 2]))
    allowed = LIMIT_M + LIMIT_SHARE * driven(common.truth)
    exceeded: NDArray[np.bool_] = np.logical_or(off > allowed, turned > LIMIT_RAD)
    return exceeded


def words() -> str:
    """The definition in words."""
    return (
        f"off by more than {LIMIT_M:g} m and {LIMIT_SHARE:.0%} of the distance driven, or by "
        f"{LIMIT_RAD:g} rad, anywhere"
    )


def by_relations(errors: RelationErrors, start: float) -> dict[str, Any]:
    """As `by_truth`, by relations off by the limits; a few broken ones are no lost run."""
    beyond = np.logical_or(
        errors.translation > POSES_OF_A_RELATION * LIMIT_M,
        errors.rotation > POSES_OF_A_RELATION * LIMIT_RAD,
    )
    order = np.argsort(errors.t, kind="stable")
    verdict = _verdict(beyond[order], errors.t[order] - start, None)
    return verdict | {"lost": bool(beyond.mean() > BROKEN_SHARE), "broken": int(beyond.sum())}


def by_report(report: dict[str, Any], scans: int) -> dict[str, Any]:
    """What the algorithm said of itself: its count of scans at which it knew it was lost."""
    count = int(report.get("lost", 0))
    return {"lost": count > REPORTED_SHARE * scans, "scans": count}


def _verdict(beyond: NDArray[np.bool_], t: Floats, reached: Floats | None) -> dict[str, Any]:
    lost = np.flatnonzero(beyond)
    first = int(lost[0]) if len(lost) else None
    return {
        "lost": first is not None,
        "at_s": None if first is None else float(t[first]),
        "after_m": None if first is None or reached is None else float(reached[first]),
        "completed": float(1.0 - beyond.mean()) if len(beyond) else 0.0,
    }
