"""Failure is a result: whether a run was lost, when, how far it had come, whether it said so."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.judge.metrics import Common, RelationErrors
from slams.metrics import driven
from slams.types import Floats, wrap_angle

LIMIT_M = 0.5  # a pose further off is lost; a robot of that size runs into a wall
LIMIT_RAD = 0.3
PATIENCE = 1.0  # s in which a loss has to be said, and a pose has to hold to count as right again
BROKEN_SHARE = 0.05  # of the relations that may be off by LIMIT_M or LIMIT_RAD
REPORTED_SHARE = 0.05  # of the scans that the algorithm itself may report as lost

Flags = NDArray[np.bool_]


def beyond(common: Common) -> Flags:
    """Where (n,) the pose is further off than the limits, in the frame of the first."""
    off = np.hypot(*(common.estimate - common.truth)[:, :2].T)
    turned = np.abs(wrap_angle(common.estimate[:, 2] - common.truth[:, 2]))
    return np.asarray((off > LIMIT_M) | (turned > LIMIT_RAD))


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


def _verdict(off: Flags, t: Floats, reached: Floats | None) -> dict[str, Any]:
    lost = np.flatnonzero(off)
    first = int(lost[0]) if len(lost) else None
    return {
        "lost": first is not None,
        "at_s": None if first is None else float(t[first]),
        "after_m": None if first is None or reached is None else float(reached[first]),
        "completed": float(1.0 - off.mean()) if len(off) else 0.0,
    }


class Alarms(NamedTuple):
    """What was said of the loss episodes of a run.

    An episode begins where the pose leaves the limits, and ends where it is within them again for
    `PATIENCE`. So many were said `in_time`: within `PATIENCE` of the beginning, or right before.
    Of `right` scans outside of all episodes, and not right before one, `false` were reported lost.
    `right_again`: the pose was within the limits at the end; None if it never left them.
    """

    episodes: int
    in_time: int
    right: int
    false: int
    right_again: bool | None


def alarms(says_lost: Flags, t: Floats, off: Flags) -> Alarms:
    """Judge what a run said of itself.

    Args:
        says_lost: the scans (n,) that the algorithm reported lost.
        t: their stamps (n,) [s]; where they jump back the clock is taken to stand still.
        off: where the pose was of no use (n,), as by `beyond`.
    """
    clock = np.maximum.accumulate(t)
    found, in_time, right = _episodes(clock, off), 0, np.ones(len(clock), bool)
    for first, after in found:
        near = np.abs(clock[:after] - clock[first]) <= PATIENCE
        in_time += int(says_lost[:after][near].any())
        right[first:after] = False
        right[:first] &= clock[:first] < clock[first] - PATIENCE  # right before it is a warning
    return Alarms(
        episodes=len(found),
        in_time=in_time,
        right=int(right.sum()),
        false=int((right & says_lost).sum()),
        right_again=not off[clock >= clock[-1] - PATIENCE].any() if found else None,
    )


def _episodes(clock: Floats, off: Flags) -> list[tuple[int, int]]:
    """First scan of each episode and the one behind its last that was off."""
    edges = np.flatnonzero(np.diff(off, prepend=False, append=False))
    found: list[tuple[int, int]] = []
    for first, after in edges.reshape(-1, 2).tolist():
        if found and clock[first] - clock[found[-1][1]] < PATIENCE:
            first = found.pop()[0]
        found.append((first, after))
    return found
