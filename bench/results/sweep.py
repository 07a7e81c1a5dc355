"""Results of a sweep: one figure row per trial, what it cost beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple, TypedDict

from bench.results import Line, read_figures, write_figures

FORMAT = "sweep-2"
CLEAN = "clean"  # the degradation that is none
TRIALS, COSTS = "sweep.json", "costs.json"


class Trial(TypedDict, total=False):
    """One algorithm on one log at one level of a degradation; the same wherever it ran.

    A trial that failed has the reason in `failed` and no figures. `place` is the kind of arena, or
    the log's name; `odometry` whether wheels and gyro were given. `lost` as in `bench.judge.loss`;
    `right_again`: within the limits at the end all the same (None: never lost). `wheels_ate_m` is
    the error of the odometry by itself.
    """

    algorithm: str
    log: str
    place: str
    seed: int
    degradation: str
    level: float
    odometry: bool
    failed: str | None
    used: list[str]
    scans: int
    duration_s: float
    ate_m: float
    second_m: float | None
    lost: bool
    right_again: bool | None
    episodes: int
    said_in_time: int
    right_scans: int
    false_alarms: int
    wheels_ate_m: float | None


class Cost(TypedDict):
    """What a trial cost, on one machine at one time: CPU of all updates [s]."""

    cpu_s: float


class Sweep(NamedTuple):
    """Trials in the order they were asked for, the cost of each, and how they were made.

    The trials of one climb follow each other, its levels rising up to the first that lost the run.
    `facts` hold on every machine (degradations with units and levels, logs with seeds, sensor);
    `record` has the command, the machine and the versions.
    """

    facts: Line
    trials: list[Trial]
    costs: list[Cost | None]
    record: Line


def save(folder: Path, sweep: Sweep) -> None:
    """Write sweep.json, the same bytes wherever it was made, and costs.json, which never is."""
    figures: dict[str, Any] = {"format": FORMAT, **sweep.facts, "trials": sweep.trials}
    write_figures(folder / TRIALS, figures)
    write_figures(folder / COSTS, {"record": sweep.record, "costs": sweep.costs})


def read(folder: str | Path) -> Sweep:
    """Read what `save` wrote.

    Raises:
        OSError: a file cannot be opened.
        ValueError: it is damaged or of another version; the sentence says why.
    """
    folder = Path(folder)
    found, spent = read_figures(folder / TRIALS, FORMAT), read_figures(folder / COSTS)
    trials = found.pop("trials")
    if len(spent["costs"]) != len(trials):
        raise ValueError(f"{folder}: {COSTS} is of another sweep than {TRIALS}; run it again")
    facts = {key: value for key, value in found.items() if key != "format"}
    return Sweep(facts, trials, spent["costs"], spent["record"])
