"""Results of a sweep: the figures and the cost of each trial."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple, TypedDict

from bench.results import Line, read_figures, write_figures

SWEEP_FORMAT = "sweep-2"
CLEAN = "clean"  # the drive without degradation
TRIALS_FILE, COSTS_FILE = "sweep.json", "costs.json"


class Trial(TypedDict, total=False):
    """One algorithm on one log at one level of a degradation; the same wherever it ran.

    A failed trial has the reason in `failed` and no figures. `place` is the kind of arena, or the
    log's name; `odometry`: whether wheels and gyro were used. `lost` as in `bench.judge.loss`;
    `right_again`: within the limits again at the end (None: never lost). `wheels_ate_m` is the
    error of the odometry alone.
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
    """CPU time of all updates of a trial [s], on one machine."""

    cpu_s: float


class Sweep(NamedTuple):
    """Trials in the order of the command, the cost of each, and the record.

    The trials of one climb are consecutive, with rising levels up to the first lost one. `facts`
    are the same on every machine (degradations with units and levels, logs with seeds, sensor);
    `record` has the command, the machine and the versions.
    """

    facts: Line
    trials: list[Trial]
    costs: list[Cost | None]
    record: Line


def save(folder: Path, sweep: Sweep) -> None:
    """Write sweep.json, with the same bytes on every machine, and costs.json."""
    figures: dict[str, Any] = {"format": SWEEP_FORMAT, **sweep.facts, "trials": sweep.trials}
    write_figures(folder / TRIALS_FILE, figures)
    write_figures(folder / COSTS_FILE, {"record": sweep.record, "costs": sweep.costs})


def read(folder: str | Path) -> Sweep:
    """Read the files of `save`.

    Raises:
        OSError: a file cannot be opened.
        ValueError: a file is damaged or has another version.
    """
    folder = Path(folder)
    found = read_figures(folder / TRIALS_FILE, SWEEP_FORMAT)
    spent = read_figures(folder / COSTS_FILE)
    trials = found.pop("trials")
    if len(spent["costs"]) != len(trials):
        raise ValueError(f"{folder}: costs.json is of another sweep than sweep.json; run it again")
    facts = {key: value for key, value in found.items() if key != "format"}
    return Sweep(facts, trials, spent["costs"], spent["record"])
