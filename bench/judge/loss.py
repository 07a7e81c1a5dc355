"""Whether a run was lost, when, after which distance, and whether it reported the loss."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.judge.metrics import Common, RelationErrors
from slams.metrics import driven
from slams.types import Floats, wrap_angle

MAX_POSITION_ERROR = 0.5  # m; with a larger error a robot of this size runs into a wall
MAX_HEADING_ERROR = 0.3  # rad
LOSS_REPORT_TIME = 1.0  # s to report a loss; a recovered pose has to hold as long
MAX_BROKEN_SHARE = 0.05  # of the relations beyond these limits
MAX_REPORTED_SHARE = 0.05  # of the scans that the algorithm itself reports as lost, or has not

Flags = NDArray[np.bool_]


def beyond(common: Common) -> Flags:
    """Where (n,) the pose error exceeds the limits, in the frame of the first pose."""
    position_error = np.hypot(*(common.estimate - common.truth)[:, :2].T)
    heading_error = np.abs(wrap_angle(common.estimate[:, 2] - common.truth[:, 2]))
    return np.asarray((position_error > MAX_POSITION_ERROR) | (heading_error > MAX_HEADING_ERROR))


def by_truth(common: Common) -> dict[str, Any]:
    """When the pose error first exceeded the limits, and the share of poses within them.

    `at_s` is the time since the log's first true pose, `after_m` the true path length; None if it
    never did. `completed` is the share of poses within the limits: a lost run may recover.
    """
    t = common.t - common.t.min()
    return _verdict(beyond(common), t, driven(common.truth))


def words() -> str:
    """The definition of a lost run in words."""
    return f"off by more than {MAX_POSITION_ERROR:g} m or {MAX_HEADING_ERROR:g} rad anywhere"


def by_relations(errors: RelationErrors, start: float) -> dict[str, Any]:
    """As `by_truth`, by relations beyond the limits; a few of them are no lost run."""
    too_far = errors.translation > MAX_POSITION_ERROR
    off = np.logical_or(too_far, errors.rotation > MAX_HEADING_ERROR)
    order = np.argsort(errors.t, kind="stable")
    verdict = _verdict(off[order], errors.t[order] - start, None)
    return verdict | {"lost": bool(off.mean() > MAX_BROKEN_SHARE), "broken": int(off.sum())}


def by_report(report: dict[str, Any], scans: int) -> dict[str, Any]:
    """Whether a run was lost by its own report: its number of lost scans."""
    count = int(report.get("lost", 0))
    return {"lost": count > MAX_REPORTED_SHARE * scans, "scans": count}


def by_end(t: Floats, scans: Floats) -> dict[str, Any]:
    """A loss at the last of the stamps t (n,) [s] if too many `scans` (k,) [s] are later, else {}.

    The end may be missing as long as any two poses are apart: of keyframes these are seconds.
    """
    end = t.max() + np.diff(np.sort(t)).max()
    if float(np.mean(scans > end)) <= MAX_REPORTED_SHARE:
        return {}
    return {"lost": True, "by": "end", "end": {"at_s": float(t.max() - scans.min())}}


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
    """How a run reported its loss episodes.

    An episode begins where the pose leaves the limits, and ends where it is within them again for
    `LOSS_REPORT_TIME`. `in_time` episodes were reported within this time before or after the
    beginning. Of `right` scans outside of all episodes, and not just before one, `false` were
    reported lost. `right_again`: within the limits at the end; None if it never left them.
    """

    episodes: int
    in_time: int
    right: int
    false: int
    right_again: bool | None


def alarms(reported_lost: Flags, t: Floats, off: Flags) -> Alarms:
    """Compare the reported losses of a run with the true ones.

    Args:
        reported_lost: the scans (n,) that the algorithm reported lost.
        t: their stamps (n,) [s]; while they jump back, the clock stands still.
        off: where (n,) the pose was beyond the limits, as by `beyond`.
    """
    clock = np.maximum.accumulate(t)
    found, in_time, right = _episodes(clock, off), 0, np.ones(len(clock), bool)
    for first, after in found:
        near = np.abs(clock[:after] - clock[first]) <= LOSS_REPORT_TIME
        in_time += int(reported_lost[:after][near].any())
        right[first:after] = False
        right[:first] &= clock[:first] < clock[first] - LOSS_REPORT_TIME  # an early warning
    return Alarms(
        episodes=len(found),
        in_time=in_time,
        right=int(right.sum()),
        false=int((right & reported_lost).sum()),
        right_again=not off[clock >= clock[-1] - LOSS_REPORT_TIME].any() if found else None,
    )


def _episodes(clock: Floats, off: Flags) -> list[tuple[int, int]]:
    """First scan of each episode, and the scan after its last one."""
    edges = np.flatnonzero(np.diff(off, prepend=False, append=False))
    found: list[tuple[int, int]] = []
    for first, after in edges.reshape(-1, 2).tolist():
        if found and clock[first] - clock[found[-1][1]] < LOSS_REPORT_TIME:
            first = found.pop()[0]
        found.append((first, after))
    return found
