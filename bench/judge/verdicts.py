"""Which algorithm is better, by how much, and with which significance, on one log or several.

A result on one log holds for this log only: another drive, or the same map rotated by 45 degrees,
may reverse it. A general result needs several independent drives.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.judge import statistics
from bench.judge.metrics import SpanErrors
from bench.results import Line, Outcome
from slams.types import Floats

Lines = list[Line]

ERROR_RESOLUTION = 1e-6  # m or rad; a smaller difference of two errors is rounding
SPAN_WORDS = {"1 s": "per second", "10 s": "per 10 s", "update": "per update"}


class Measure(NamedTuple):
    """A kind of error to compare, [m] or [rad], and the unit in sentences."""

    name: str
    values: Callable[[SpanErrors], Floats]
    unit: str


ERROR_MEASURES = (
    Measure("translation", lambda errors: errors.se2_translation, "mm"),
    Measure("rotation", lambda errors: errors.orientation, "mrad"),
)


class Series(NamedTuple):
    """Errors (n,) of an algorithm, with their keys: stamps, or numbers of logs."""

    name: str
    keys: NDArray[np.float64]
    values: Floats


def on_one_log(outcomes: list[Outcome]) -> Lines:
    """Every pair of runs that have errors, p-values adjusted together for all of them.

    They use errors over 1 s, if the log is long enough: these do not depend on the update rate.
    """
    runs = [outcome for outcome in outcomes if outcome.errors]
    span = next((name for name in SPAN_WORDS if all(name in run.errors for run in runs)), None)
    if span is None or len(runs) < 2:
        return []
    found: Lines = []
    for measure in ERROR_MEASURES:
        errors = ((run.row["algorithm"], run.errors[span]) for run in runs)
        series = [Series(name, of.t, measure.values(of)) for name, of in errors]
        found += _pairs(series, measure, SPAN_WORDS[span], statistics.paired)
    return [entry | {"sentence": _words(entry, "on this log")} for entry in _adjusted(found)]


def over_logs(logs: list[list[Outcome]], span: str = "1 s") -> Lines:
    """Every pair of algorithms over the runs of all logs: a mean per log, tested over the logs.

    The logs have to be independent drives. Five never suffice for a p-value below 0.05.
    """
    found: Lines = []
    for measure in ERROR_MEASURES:
        means: dict[str, dict[float, float]] = {}
        for number, outcome in ((k, one) for k, log in enumerate(logs) for one in log):
            if span in outcome.errors:
                mean = float(measure.values(outcome.errors[span]).mean())
                means.setdefault(outcome.row["algorithm"], {})[float(number)] = mean
        series = [
            Series(name, np.array([*of]), np.array([*of.values()])) for name, of in means.items()
        ]
        found += _pairs(series, measure, SPAN_WORDS[span], statistics.paired_over_runs)
    found = [entry for entry in found if entry["n"] >= 2]
    return [
        entry | {"sentence": _words(entry, f"over {entry['n']} logs")} for entry in _adjusted(found)
    ]


def _pairs(
    series: list[Series],
    measure: Measure,
    what: str,
    test: Callable[[Floats, Floats], statistics.Paired],
) -> Lines:
    """Every pair at the keys that both have, the best algorithm first."""
    order = sorted(series, key=lambda one: float(one.values.mean()))
    return [
        {
            "a": a.name,
            "b": b.name,
            "measure": measure.name,
            "what": what,
            "unit": measure.unit,
            "next": j - i == 1,
        }
        | test(*_shared(a, b))._asdict()
        for (i, a), (j, b) in combinations(enumerate(order), 2)
    ]


def _shared(a: Series, b: Series) -> tuple[Floats, Floats]:
    """The values of both series at shared keys; differences by rounding are removed."""
    first, second = a.values, b.values
    if not np.array_equal(a.keys, b.keys):
        _, of_a, of_b = np.intersect1d(a.keys, b.keys, return_indices=True)
        first, second = first[of_a], second[of_b]
    return first, np.where(np.abs(first - second) < ERROR_RESOLUTION, first, second)


def _adjusted(found: Lines) -> Lines:
    """Add the p-values corrected over all pairs."""
    adjusted = statistics.adjusted([entry["p_value"] for entry in found])
    return [
        entry | {"p_alone": entry["p_value"], "p_value": p_value}
        for entry, p_value in zip(found, adjusted, strict=True)
    ]


def _words(entry: Line, where: str) -> str:
    """A pair as a sentence, with the scope `where`."""
    paired = statistics.Paired(**{name: entry[name] for name in statistics.Paired._fields})
    pair = entry["a"], entry["b"]
    words = statistics.sentence(*pair, paired, entry["unit"], entry["what"], where)
    return f"{entry['measure']}: {words}"
