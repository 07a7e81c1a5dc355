"""Failure is a result: whether a run was lost, when, and how far it had come."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.judge.alarms import LIMIT_M, LIMIT_RAD, beyond
from bench.judge.metrics import Common, RelationErrors
from slams.metrics import driven
from slams.types import Floats

BROKEN_SHARE = 0.05  # of the relations that may be off by LIMIT_M or LIMIT_RAD
REPORTED_SHARE = 0.05  # of the scans that the algorithm itself may report as lost


def by_truth(common: Common) -> dict[str, Any]:
    """When the pose first was off by more than the limits, and for which share it was not.

    `at_s` from the log's first truth on and `after_m` of the true path; None if it never was.
    `completed` is the share of the poses within the limits: a lost run may come back.
    """
    t = common.t - common.t.min()
    return _verdict(beyond(common), t, driven(common.truth))


def words() -> str:
    """The definition in words."""
    return f"off by more than {LIMIT_M:g} m or {LIMIT_RAD:g} rad anywhere"


def by_relations(errors: RelationErrors, start: float) -> dict[str, Any]:
    """As `by_truth`, by relations off by the limits; a few broken ones are no lost run."""
    off = np.logical_or(errors.translation > LIMIT_M, errors.rotation > LIMIT_RAD)
    order = np.argsort(errors.t, kind="stable")
    verdict = _verdict(off[order], errors.t[order] - start, None)
    return verdict | {"lost": bool(off.mean() > BROKEN_SHARE), "broken": int(off.sum())}


def by_report(report: dict[str, Any], scans: int) -> dict[str, Any]:
    """What the algorithm reports: its count of scans at which it was lost."""
    count = int(report.get("lost", 0))
    return {"lost": count > REPORTED_SHARE * scans, "scans": count}


def _verdict(off: NDArray[np.bool_], t: Floats, reached: Floats | None) -> dict[str, Any]:
    lost = np.flatnonzero(off)
    first = int(lost[0]) if len(lost) else None
    return {
        "lost": first is not None,
        "at_s": None if first is None else float(t[first]),
        "after_m": None if first is None or reached is None else float(reached[first]),
        "completed": float(1.0 - off.mean()) if len(off) else 0.0,
    }
