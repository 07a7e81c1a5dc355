"""Whether a run that lost its way said so: missed, late and false alarms."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.judge.metrics import Common
from slams.types import Floats, wrap_angle

LIMIT_M = 0.5  # a pose further off is lost; a robot of that size runs into a wall
LIMIT_RAD = 0.3
PATIENCE = 1.0  # s in which a loss has to be said, and a pose has to hold to count as right again

Flags = NDArray[np.bool_]


class Alarms(NamedTuple):
    """What was said of the loss episodes of a run.

    An episode begins where the pose leaves the limits, and ends where it is within them again for
    `PATIENCE`. Each is `in_time`, `late` (said, but only while it lasted on) or `missed`. `delays`
    [s] are from the beginning to the first alarm, of those that were said; 0 if it came before.
    Of `right` scans outside of all episodes, and not right before one, `false` were reported lost.
    `right_again`: the pose was within the limits at the end; None if it never left them.
    """

    episodes: int
    in_time: int
    late: int
    missed: int
    delays: tuple[float, ...]
    right: int
    false: int
    right_again: bool | None


def beyond(common: Common, limit_m: float = LIMIT_M, limit_rad: float = LIMIT_RAD) -> Flags:
    """Where (n,) the pose is further off than the limits, in the frame of the first."""
    off = np.hypot(*(common.estimate - common.truth)[:, :2].T)
    turned = np.abs(wrap_angle(common.estimate[:, 2] - common.truth[:, 2]))
    return np.asarray((off > limit_m) | (turned > limit_rad))


def alarms(says_lost: Flags, t: Floats, off: Flags, patience: float = PATIENCE) -> Alarms:
    """Judge what a run said of itself.

    Args:
        says_lost: the scans (n,) that the algorithm reported lost.
        t: their stamps (n,) [s]; where they jump back the clock is taken to stand still.
        off: where the pose was of no use (n,), as by `beyond`.
        patience: in which a loss has to be said [s], and which an episode's end has to hold.

    Raises:
        ValueError: there is no scan, or not as many of each.
    """
    if not len(t) or not len(says_lost) == len(t) == len(off):
        raise ValueError(
            f"alarms: got {len(says_lost)} flags, {len(t)} stamps and {len(off)} errors, expected "
            "as many of each, one at least"
        )
    clock = np.maximum.accumulate(t)
    found = _episodes(clock, off, patience)
    delays = [_delay(clock, says_lost, *episode, patience) for episode in found]
    said = tuple(delay for delay in delays if delay is not None)
    in_time = sum(delay <= patience for delay in said)
    right = _right(clock, found, patience)
    return Alarms(
        episodes=len(found),
        in_time=in_time,
        late=len(said) - in_time,
        missed=len(found) - len(said),
        delays=said,
        right=int(right.sum()),
        false=int((right & says_lost).sum()),
        right_again=not off[clock >= clock[-1] - patience].any() if found else None,
    )


def _episodes(clock: Floats, off: Flags, patience: float) -> list[tuple[int, int]]:
    """First scan of each episode and the one behind its last that was off."""
    edges = np.flatnonzero(np.diff(off, prepend=False, append=False))
    found: list[tuple[int, int]] = []
    for first, after in edges.reshape(-1, 2).tolist():
        if found and clock[first] - clock[found[-1][1]] < patience:
            first = found.pop()[0]
        found.append((first, after))
    return found


def _delay(
    clock: Floats, says_lost: Flags, first: int, after: int, patience: float
) -> float | None:
    """Time from an episode's beginning to the first alarm [s]; None without any."""
    reported = says_lost & (clock >= clock[first] - patience)
    reported[after:] = False
    if not reported.any():
        return None
    return max(0.0, float(clock[np.argmax(reported)] - clock[first]))


def _right(clock: Floats, episodes: list[tuple[int, int]], patience: float) -> Flags:
    """Scans in no episode, and not so shortly before one that an alarm would be a warning."""
    right = np.ones(len(clock), bool)
    for first, after in episodes:
        right[first:after] = False
        right[:first] &= clock[:first] < clock[first] - patience
    return right
