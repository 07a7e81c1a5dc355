"""Which algorithm is better, by how much, and how sure that is: pairs on one log and over logs.

What one log shows holds on that log: another drive, or the same map turned by 45 degrees, may
show the opposite. Only several independent drives say more, and too few of them say nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any, NamedTuple, TypeVar

import numpy as np

from bench.judge import statistics
from bench.judge.metrics import SpanErrors
from bench.results import Line, Outcome
from slams.types import Floats

Lines = list[Line]
T = TypeVar("T")

SIGNIFICANT = 0.05
RESOLUTION = 1e-6  # m or rad: a smaller difference of two errors is rounding


class Measure(NamedTuple):
    """What pairs are compared by: a series of errors, and how it is put in words."""

    name: str
    values: Callable[[SpanErrors], Floats]
    unit: str
    scale: float


MEASURES = (
    Measure("translation", lambda errors: errors.se2_translation, "mm", 1e3),
    Measure("rotation", lambda errors: errors.orientation, "mrad", 1e3),
)
SPANS = {"1 s": "per second", "10 s": "per 10 s", "update": "per update"}


def on_one_log(outcomes: list[Outcome]) -> Lines:
    """Every pair of runs that have errors, p-values adjusted together for all of them.

    Errors over 1 s, where the log has them; they do not depend on the rate of the updates. The
    sentences hold on this log and say so.
    """
    runs = _judged(outcomes)
    span = next((name for name in SPANS if all(name in run.errors for run in runs)), None)
    if span is None or len(runs) < 2:
        return []
    found: Lines = []
    for measure in MEASURES:
        order = sorted(runs, key=lambda run: float(measure.values(run.errors[span]).mean()))
        for places, (a, b) in _numbered_pairs(order):
            paired = statistics.paired(*_same_times(a.errors[span], b.errors[span], measure))
            pair = a.row["algorithm"], b.row["algorithm"]
            found.append(_entry(pair, measure, SPANS[span], paired, beside=places == 1))
    return [entry | {"sentence": _words(entry, "on this log")} for entry in _adjusted(found)]


def over_logs(outcomes: list[Outcome], span: str = "1 s") -> Lines:
    """Every pair of algorithms over all logs: one mean per log, tested over the logs.

    The only verdict that may claim more than one log shows, if the logs are independent drives.
    Where there are too few for any p-value below 0.05, the sentence says so instead.
    """
    found: Lines = []
    for measure in MEASURES:
        order = _ordered_means(outcomes, span, measure)
        found += _pairs(order, measure, SPANS[span])
    logs = [entry["n"] for entry in found]
    return [entry | {"sentence": _words_over(entry, logs)} for entry in _adjusted(found)]


def _pairs(order: list[tuple[str, dict[str, float]]], measure: Measure, what: str) -> Lines:
    """Every pair of algorithms on the logs that both have."""
    found: Lines = []
    for places, ((a, of_a), (b, of_b)) in _numbered_pairs(order):
        shared = [log for log in of_a if log in of_b]
        if len(shared) < 2:
            continue
        paired = statistics.paired_over_runs(
            np.array([of_a[log] for log in shared]), np.array([of_b[log] for log in shared])
        )
        found.append(_entry((a, b), measure, what, paired, beside=places == 1))
    return found


def _ordered_means(
    outcomes: list[Outcome], span: str, measure: Measure
) -> list[tuple[str, dict[str, float]]]:
    """Each algorithm's mean error on each log, the best algorithm first."""
    means: dict[str, dict[str, float]] = {}
    for outcome in _judged(outcomes):
        if span in outcome.errors:
            of_logs = means.setdefault(outcome.row["algorithm"], {})
            of_logs[outcome.row["log"]] = float(measure.values(outcome.errors[span]).mean())
    return sorted(means.items(), key=lambda item: float(np.mean([*item[1].values()])))


def _numbered_pairs(order: Sequence[T]) -> list[tuple[int, tuple[T, T]]]:
    """All pairs in order, each with how many places lie between."""
    numbered = list(enumerate(order))
    return [(j - i, (a, b)) for (i, a), (j, b) in combinations(numbered, 2)]


def _judged(outcomes: list[Outcome]) -> list[Outcome]:
    return [outcome for outcome in outcomes if outcome.errors]


def _same_times(a: SpanErrors, b: SpanErrors, measure: Measure) -> tuple[Floats, Floats]:
    """Both series at the stamps that both have; what differs by rounding alone is equal."""
    first, second = measure.values(a), measure.values(b)
    if not np.array_equal(a.t, b.t):
        _, of_a, of_b = np.intersect1d(a.t, b.t, return_indices=True)
        first, second = first[of_a], second[of_b]
    return first, np.where(np.abs(first - second) < RESOLUTION, first, second)


def _entry(
    pair: tuple[str, str], measure: Measure, what: str, paired: statistics.Paired, beside: bool
) -> dict[str, Any]:
    return {
        "a": pair[0],
        "b": pair[1],
        "measure": measure.name,
        "what": what,
        "unit": measure.unit,
        "next": beside,
    } | paired._asdict()


def _adjusted(found: Lines) -> Lines:
    """Add the p-values for all pairs together."""
    adjusted = statistics.adjusted([entry["p_value"] for entry in found])
    return [
        entry | {"p_alone": entry["p_value"], "p_value": p_value}
        for entry, p_value in zip(found, adjusted, strict=True)
    ]


def _words(entry: dict[str, Any], where: str) -> str:
    """A pair in words, limited to where it holds."""
    paired = statistics.Paired(**{name: entry[name] for name in statistics.Paired._fields})
    scale = next(measure.scale for measure in MEASURES if measure.name == entry["measure"])
    words = statistics.sentence(
        entry["a"], entry["b"], paired, entry["unit"], scale, entry["what"], where=where
    )
    return f"{entry['measure']}: {words}"


def _words_over(entry: dict[str, Any], logs: list[int]) -> str:
    """A pair in words; of too few logs, that they cannot show anything.

    `logs` is how many each pair has: those with no more logs than this one have no better p-values
    at best, so that Holm's factor is at least their number.
    """
    n, words = entry["n"], _words(entry, f"over {entry['n']} logs")
    tests = sum(other <= n for other in logs)
    least = min(1.0, tests * statistics.least_p_value(n))
    if least < SIGNIFICANT:
        return words
    return f"{words}; {n} logs cannot show it: the least p among {tests} comparisons is {least:.2g}"
