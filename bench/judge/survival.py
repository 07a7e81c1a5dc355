"""What a sweep says: who survives what, how sure that is, at which error and at which cost.

Pure functions on the trials of a sweep. Trials that failed count as lost.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from bench.judge.statistics import wilson
from bench.results.sweep import Cost, Sweep, Trial

K = TypeVar("K", bound=Hashable)

CLEAN = "clean"


class Share(NamedTuple):
    """k of n, and the 95 % Wilson interval of the share."""

    k: int
    n: int
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.k} of {self.n}"


class Group(NamedTuple):
    """All trials of one kind together.

    `ate_m` and `worst_ate_m` are median and greatest error of the runs that survived, None without
    any; `worse_than_wheels` counts runs with odometry that were further off than the wheels alone;
    `right_again` the lost runs that were right at their end; `cpu` CPU seconds per second of log,
    median; `cpu_scan` per scan.
    """

    survived: Share
    ate_m: float | None
    worst_ate_m: float | None
    second_m: float | None
    worse_than_wheels: Share
    right_again: Share
    said_in_time: Share
    false_share: float
    posed: float | None
    refined: float | None
    cpu: float | None
    cpu_scan: float | None


class Survivors(NamedTuple, Generic[K]):
    """The greatest share survived, who has it, and all that cannot be distinguished from it."""

    most: Share
    best: list[K]
    alike: list[K]


class Judged(NamedTuple):
    """A trial with what it cost."""

    trial: Trial
    cost: Cost | None


def grouped(sweep: Sweep, key: Callable[[Trial], K]) -> dict[K, Group]:
    """The trials of each kind weighed together, in the order the kinds appear."""
    found: dict[K, list[Judged]] = {}
    for trial, cost in zip(sweep.trials, sweep.costs, strict=True):
        found.setdefault(key(trial), []).append(Judged(trial, cost))
    return {kind: weigh(trials) for kind, trials in found.items()}


def weigh(judged: list[Judged]) -> Group:
    """Trials of one kind, together."""
    trials = [item.trial for item in judged]
    done = [trial for trial in trials if not trial["failed"]]
    kept = [trial for trial in done if not trial["lost"]]
    lost = [trial for trial in done if trial["lost"]]
    beside = [trial for trial in done if trial["odometry"] and trial["wheels_ate_m"] is not None]
    worse = [trial for trial in beside if trial["ate_m"] > (trial["wheels_ate_m"] or 0.0)]
    episodes = sum(trial["episodes"] for trial in done)
    right = sum(trial["right_scans"] for trial in done)
    known = [(i, i.cost["cpu_s"]) for i in judged if i.cost and not i.trial["failed"]]
    return Group(
        survived=share(len(kept), len(trials)),
        ate_m=_median(trial["ate_m"] for trial in kept),
        worst_ate_m=max((trial["ate_m"] for trial in kept), default=None),
        second_m=_median(t["second_m"] for t in kept if t["second_m"] is not None),
        worse_than_wheels=share(len(worse), len(beside)),
        right_again=share(sum(bool(trial["right_again"]) for trial in lost), len(lost)),
        said_in_time=share(sum(trial["said_in_time"] for trial in done), episodes),
        false_share=sum(trial["false_alarms"] for trial in done) / max(right, 1),
        posed=_mean(t["posed"] for t in done if t["posed"] is not None),
        refined=_mean(t["refined"] for t in done if t["refined"] is not None),
        cpu=_median(_per_second(item) for item, _ in known),
        cpu_scan=_median(cpu_s / max(item.trial["scans"], 1) for item, cpu_s in known),
    )


def survivors(groups: Mapping[K, Group]) -> Survivors[K]:
    """Who survived most, and who cannot be distinguished from them: their intervals overlap."""
    most = max(groups.values(), key=lambda group: group.survived.k).survived
    best = [name for name, group in groups.items() if group.survived.k == most.k]
    alike = [name for name, group in groups.items() if group.survived.high >= most.low]
    return Survivors(most, best, alike)


def cheapest(groups: Mapping[K, Group], among: Iterable[K]) -> K | None:
    """The one of `among` that takes the least CPU; None where nobody's cost is known."""
    spent = {name: groups[name].cpu for name in among}
    known = {name: cpu for name, cpu in spent.items() if cpu is not None}
    return min(known, key=lambda name: known[name], default=None)


def share(k: int, n: int) -> Share:
    """K of n with its Wilson interval."""
    return Share(k, n, *wilson(k, n))


def discordant(sweep: Sweep, a: str, b: str) -> tuple[int, int]:
    """Runs that of two algorithms only a survived, and only b; a pair has log and condition alike.

    Raises:
        KeyError: a run of one that the other has not.
    """
    kept: dict[str, dict[Hashable, bool]] = {a: {}, b: {}}
    for trial in sweep.trials:
        if trial["algorithm"] in kept:
            kept[trial["algorithm"]][_pair(trial)] = survived(trial)
    pairs = [(kept[a][pair], kept[b][pair]) for pair in kept[a] | kept[b]]
    return pairs.count((True, False)), pairs.count((False, True))


def survived(trial: Trial) -> bool:
    """Whether a run kept its way; one that failed did not."""
    return not trial["failed"] and not trial["lost"]


def reach(sweep: Sweep, algorithm: str, odometry: bool, degradation: str) -> float | None:
    """The hardest level up to which every run survived, this and all milder ones.

    Levels are as hard as they stand in the sweep, in the order of the catalog. None: lost already
    at the mildest.
    """
    whole: dict[float, bool] = {}
    for trial in sweep.trials:
        same = (trial["algorithm"], trial["odometry"], trial["degradation"])
        if same == (algorithm, odometry, degradation):
            whole[trial["level"]] = whole.get(trial["level"], True) and survived(trial)
    last = None
    for level, every in whole.items():
        if not every:
            break
        last = level
    return last


def cost_ratio(sweep: Sweep, algorithm: str, odometry: bool) -> float | None:
    """The dearest case's CPU per second of log as a multiple of the same log's, clean."""
    clean: dict[str, float] = {}
    others: list[tuple[str, float]] = []
    for item in map(Judged, sweep.trials, sweep.costs):
        trial = item.trial
        if (trial["algorithm"], trial["odometry"]) != (algorithm, odometry):
            continue
        if item.cost is None or trial["failed"]:
            continue
        if trial["degradation"] == CLEAN:
            clean[trial["log"]] = _per_second(item)
        else:
            others.append((trial["log"], _per_second(item)))
    ratios = [spent / clean[log] for log, spent in others if clean.get(log)]
    return max(ratios, default=None)


def clean_errors(sweep: Sweep, odometry: bool) -> dict[str, dict[str, float]]:
    """Mean error over a second [m] of each algorithm on each clean log: what verdicts are from."""
    found: dict[str, dict[str, float]] = {}
    for trial in sweep.trials:
        if trial["degradation"] == CLEAN and trial["odometry"] == odometry and not trial["failed"]:
            second = trial["second_m"]
            if second is not None:
                found.setdefault(trial["algorithm"], {})[trial["log"]] = second
    return found


def _pair(trial: Trial) -> Hashable:
    """What two runs of a pair have alike."""
    log, condition = (trial["log"], trial["seed"]), (trial["degradation"], trial["level"])
    return log, condition, trial["odometry"]


def _per_second(item: Judged) -> float:
    assert item.cost is not None, "asked for trials with a cost only"
    return item.cost["cpu_s"] / max(item.trial["duration_s"], 1e-9)


def _median(values: Iterable[float]) -> float | None:
    known = list(values)
    return float(np.median(known)) if known else None


def _mean(values: Iterable[float]) -> float | None:
    known = list(values)
    return float(np.mean(known)) if known else None
