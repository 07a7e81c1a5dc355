"""Which algorithm is better, by how much, and how sure that is: pairs on one log and over logs."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from bench.judge import statistics
from bench.judge.metrics import SpanErrors
from bench.results import Line, Outcome
from slams.types import Floats

Lines = list[Line]


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

    Errors over 1 s, where the log has them; they do not depend on the rate of the updates.
    """
    span = next((name for name in SPANS if all(name in o.errors for o in _judged(outcomes))), None)
    if span is None or len(_judged(outcomes)) < 2:
        return []
    found: Lines = []
    for measure in MEASURES:
        order = sorted(
            _judged(outcomes), key=lambda o: float(measure.values(o.errors[span]).mean())
        )
        rank = {id(outcome): k for k, outcome in enumerate(order)}
        for a, b in combinations(order, 2):
            paired = statistics.paired(*_same_times(a.errors[span], b.errors[span], measure))
            beside = rank[id(b)] - rank[id(a)] == 1
            names = a.row["algorithm"], b.row["algorithm"]
            found.append(_entry(*names, measure, SPANS[span], paired, beside))
    return _adjusted(found)


def over_logs(outcomes: list[Outcome], span: str = "1 s") -> Lines:
    """Every pair of algorithms over all logs: one mean per log, tested over the logs."""
    means: dict[str, dict[str, dict[str, float]]] = {measure.name: {} for measure in MEASURES}
    for outcome in _judged(outcomes):
        if span in outcome.errors:
            for measure in MEASURES:
                known = means[measure.name].setdefault(outcome.row["algorithm"], {})
                known[outcome.row["log"]] = float(measure.values(outcome.errors[span]).mean())
    found: Lines = []
    for measure in MEASURES:
        order = sorted(means[measure.name].items(), key=lambda item: np.mean([*item[1].values()]))
        for k, ((a, of_a), (b, of_b)) in _numbered_pairs(order):
            shared = [log for log in of_a if log in of_b]
            if len(shared) < 2:
                continue
            paired = statistics.paired_over_runs(
                np.array([of_a[log] for log in shared]), np.array([of_b[log] for log in shared])
            )
            found.append(_entry(a, b, measure, SPANS[span], paired, beside=k == 1))
    return _adjusted(found)


def _numbered_pairs(order: list[Any]) -> list[tuple[int, tuple[Any, Any]]]:
    """All pairs in order, each with how many places lie between."""
    numbered = list(enumerate(order))
    return [(j - i, (a, b)) for (i, a), (j, b) in combinations(numbered, 2)]


def _judged(outcomes: list[Outcome]) -> list[Outcome]:
    return [outcome for outcome in outcomes if outcome.errors]


def _same_times(a: SpanErrors, b: SpanErrors, measure: Measure) -> tuple[Floats, Floats]:
    """Both series at the stamps that both have."""
    if np.array_equal(a.t, b.t):
        return measure.values(a), measure.values(b)
    _, of_a, of_b = np.intersect1d(a.t, b.t, return_indices=True)
    return measure.values(a)[of_a], measure.values(b)[of_b]


def _entry(
    a: str,
    b: str,
    measure: Measure,
    what: str,
    paired: statistics.Paired,
    beside: bool,
) -> dict[str, Any]:
    return {
        "a": a,
        "b": b,
        "measure": measure.name,
        "what": what,
        "unit": measure.unit,
        "scale": measure.scale,
        "next": beside,
    } | paired._asdict()


def _adjusted(found: Lines) -> Lines:
    """Add the p-values for all pairs together, and each pair in words."""
    adjusted = statistics.adjusted([entry["p_value"] for entry in found])
    for entry, p_value in zip(found, adjusted, strict=True):
        entry["p_alone"], entry["p_value"] = entry["p_value"], p_value
        paired = statistics.Paired(**{k: entry[k] for k in statistics.Paired._fields})
        words = statistics.sentence(
            entry["a"], entry["b"], paired, entry["unit"], entry.pop("scale"), entry["what"]
        )
        entry["sentence"] = f"{entry['measure']}: {words}"
    return found
