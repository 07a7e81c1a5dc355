"""Robustness of the runs of a sweep: levels held, survival curves, critical levels, row figures.

A run *holds* a level if neither this level nor a milder one is lost. The climb ends at the first
lost level. A failed run counts as lost.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from bench.judge.statistics import Share, wilson
from bench.results.sweep import CLEAN, Cost, Sweep, Trial

CRITICAL_LOST_SHARE = 0.5  # of the runs, lost at the critical level

Drive = tuple[str, int]  # name of a log, seed
Held = dict[Drive, int]  # number of levels held, by drive
Errors = dict[tuple[str, int, str, float], float]  # error over 1 s by drive, degradation, level


class Critical(NamedTuple):
    """The level at which half of the runs are lost, and its 95 % interval.

    -inf: below the mildest level tested, inf: above the hardest.
    """

    level: float
    low: float
    high: float


class Figures(NamedTuple):
    """The figures of one row over all its trials.

    `levels`: levels held and all levels, over all drives. `second_m` is the median error over 1 s
    of the runs that were not lost, `clean_m` the same without degradation; None without any.
    `cpu_scan` [s] is a median. `dearest` is the largest CPU time per second of log of any trial,
    relative to the same log without degradation.
    """

    used: list[str]
    levels: tuple[int, int]
    clean: Share
    second_m: float | None
    clean_m: float | None
    worse_than_wheels: Share
    right_again: Share
    reported_in_time: Share
    false_share: float
    cpu_scan: float | None
    dearest: float | None


def survived(trial: Trial) -> bool:
    """Whether a run was neither lost nor failed."""
    return not trial["failed"] and not trial["lost"]


def held(trials: Iterable[Trial], odometry: bool, degradations: Collection[str]) -> dict[str, Held]:
    """Levels held by each algorithm, by drive, summed over some degradations."""
    found: dict[str, Held] = {}
    for trial in trials:
        if trial["odometry"] == odometry and trial["degradation"] in degradations:
            drives = found.setdefault(trial["algorithm"], {})
            drive = trial["log"], trial["seed"]
            drives[drive] = drives.get(drive, 0) + survived(trial)
    return found


def errors(
    trials: Iterable[Trial], odometry: bool, degradations: Collection[str]
) -> dict[str, Errors]:
    """Error over 1 s [m] of each algorithm's runs that were not lost."""
    found: dict[str, Errors] = {}
    for trial in trials:
        if trial["odometry"] != odometry or trial["degradation"] not in degradations:
            continue
        if survived(trial) and trial["second_m"]:
            key = trial["log"], trial["seed"], trial["degradation"], trial["level"]
            found.setdefault(trial["algorithm"], {})[key] = trial["second_m"]
    return found


def votes(a: Held, b: Held) -> tuple[int, int]:
    """Number of logs in which a held more levels over all seeds, and in which b did."""
    more: Counter[str] = Counter()
    for drive in a.keys() & b.keys():
        more[drive[0]] += a[drive] - b[drive]
    return sum(n > 0 for n in more.values()), sum(n < 0 for n in more.values())


def curve(runs: Held, levels: int) -> list[Share]:
    """The share of runs that hold each level: Kaplan and Meier's curve without censoring."""
    counts = list(runs.values())
    return [wilson(sum(count > k for count in counts), len(counts)) for k in range(levels)]


def critical(shares: Sequence[Share], levels: Sequence[float]) -> Critical:
    """The level at which half of the runs are lost.

    The median of Kaplan and Meier's curve, interpolated on a logarithmic scale. Its interval
    inverts a test at each level (Brookmeyer and Crowley 1982), here by Wilson's interval: from the
    last level held by significantly more than half of the runs to the first held by significantly
    fewer.
    """
    lows, highs = ([getattr(one, side) for one in shares] for side in ("low", "high"))
    first, last = _falls(lows), _falls(highs)
    return Critical(
        _crossing([one.k / one.n for one in shares], levels),
        levels[first - 1] if first else -math.inf,
        levels[last] if last < len(levels) else math.inf,
    )


def _falls(shares: Sequence[float]) -> int:
    """Index of the first of falling shares that is at most one half; their number if none is."""
    return next((k for k, value in enumerate(shares) if value <= CRITICAL_LOST_SHARE), len(shares))


def _crossing(shares: Sequence[float], levels: Sequence[float]) -> float:
    below = _falls(shares)
    if below == len(shares):
        return math.inf
    if below == 0:
        return levels[0] if shares[0] == CRITICAL_LOST_SHARE else -math.inf
    (a, b), (above, under) = levels[below - 1 : below + 1], shares[below - 1 : below + 1]
    part = (above - CRITICAL_LOST_SHARE) / (above - under)
    return float(a * (b / a) ** part if a > 0.0 and b > 0.0 else a + part * (b - a))


def figures(sweep: Sweep, algorithm: str, odometry: bool) -> Figures:
    """The figures of one row of a sweep."""
    own = [
        (trial, cost)
        for trial, cost in zip(sweep.trials, sweep.costs, strict=True)
        if (trial["algorithm"], trial["odometry"]) == (algorithm, odometry)
    ]
    done = [trial for trial, _ in own if not trial["failed"]]
    kept, lost = ([t for t in done if t["lost"] == is_lost] for is_lost in (False, True))
    clean = [trial for trial, _ in own if trial["degradation"] == CLEAN]
    with_wheels = [trial for trial in done if odometry and trial["wheels_ate_m"] is not None]
    worse = [trial for trial in with_wheels if trial["ate_m"] > (trial["wheels_ate_m"] or 0.0)]
    right = sum(trial["right_scans"] for trial in done)
    return Figures(
        used=list(dict.fromkeys(name for trial in done for name in trial["used"])),
        levels=_levels(sweep, [trial for trial, _ in own]),
        clean=wilson(sum(map(survived, clean)), len(clean)),
        second_m=_second(kept),
        clean_m=_second([trial for trial in kept if trial["degradation"] == CLEAN]),
        worse_than_wheels=wilson(len(worse), len(with_wheels)),
        right_again=wilson(sum(bool(trial["right_again"]) for trial in lost), len(lost)),
        reported_in_time=wilson(
            sum(trial["said_in_time"] for trial in done), sum(trial["episodes"] for trial in done)
        ),
        false_share=sum(trial["false_alarms"] for trial in done) / max(right, 1),
        cpu_scan=median([cost["cpu_s"] / max(t["scans"], 1) for t, cost in own if cost]),
        dearest=_dearest(own),
    )


def median(values: Sequence[float]) -> float | None:
    """The median; None without values."""
    return float(np.median(values)) if len(values) else None


def _second(trials: Iterable[Trial]) -> float | None:
    return median([t["second_m"] for t in trials if t["second_m"] is not None])


def _levels(sweep: Sweep, own: Sequence[Trial]) -> tuple[int, int]:
    """Levels held and number of levels; logs without degradation do not count."""
    degraded = [trial for trial in own if trial["degradation"] != CLEAN]
    climbs = {(t["log"], t["seed"], t["degradation"]) for t in degraded}
    return (
        sum(map(survived, degraded)),
        sum(len(sweep.facts["levels"][name]) for *_, name in climbs),
    )


def _dearest(own: Sequence[tuple[Trial, Cost | None]]) -> float | None:
    clean: dict[str, float] = {}
    others: list[tuple[str, float]] = []
    for trial, cost in own:
        if cost is None:
            continue
        spent = cost["cpu_s"] / max(trial["duration_s"], 1e-9)
        if trial["degradation"] == CLEAN:
            clean[trial["log"]] = spent
        else:
            others.append((trial["log"], spent))
    return max((spent / clean[log] for log, spent in others if clean.get(log)), default=None)
