"""Accuracy against cost, and the Pareto front."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from bench.report.lines import deciding_errors, is_lost

if TYPE_CHECKING:
    from bench.results import Comparison


class Point(NamedTuple):
    """An algorithm: mean CPU time per scan [ms] and error [mm], nan if unknown.

    The error is that over 1 s, or of the relations; `lost` is the number of logs on which the run
    was lost or failed.
    """

    name: str
    cpu_ms: float
    error_mm: float
    lost: int


def points(comparison: Comparison) -> list[Point]:
    """A point for each algorithm, means over the logs."""
    found, by_log = [], [deciding_errors(log.rows) for log in comparison.logs]
    for name, rows in comparison.by_algorithm().items():
        errors = [1e3 * error for of in by_log if (error := of.get(name)) is not None]
        costs = [cost["mean_ms"] for row in rows if (cost := row.get("cost"))]
        found.append(Point(name, _mean(costs), _mean(errors), sum(map(is_lost, rows))))
    return found


def _mean(values: list[float]) -> float:
    return sum(values) / len(values) if values else math.nan


def drawn(comparison: Comparison) -> list[Point]:
    """The points that have an error and a cost."""
    return [one for one in points(comparison) if not math.isnan(one.cpu_ms + one.error_mm)]


def front(of: Sequence[Point]) -> list[Point]:
    """The Pareto front of the points that were not lost, by cost and error."""
    found: list[Point] = []
    kept = (point for point in of if not point.lost)
    for point in sorted(kept, key=lambda point: (point.cpu_ms, point.error_mm)):
        if not found or point.error_mm < found[-1].error_mm:
            found.append(point)
    return found
