"""Accuracy against cost: the algorithms that no other one beats in both."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from bench.report.lines import deciding_error
from bench.report.words import by_algorithm

if TYPE_CHECKING:
    from bench.results import Comparison, LogResult

NAME_WIDTH, STEP = 0.15, 0.055  # of the figure, that a name takes
LOWEST, HIGHEST = 0.01, 0.94  # of the figure, where a name is written


class Point(NamedTuple):
    """An algorithm: CPU time per scan [ms], error [mm], whether it was lost on any log."""

    name: str
    cpu_ms: float
    error_mm: float
    lost: bool


def points(comparison: Comparison) -> list[Point]:
    """A point for each algorithm that has an error and a cost, means over the logs."""
    found = []
    for name, rows in by_algorithm(comparison).items():
        known = [
            (row["cost"]["mean_ms"], error)
            for row in rows
            if not row["failed"] and row["cost"] and (error := deciding_error(row)) is not None
        ]
        if known:
            cpu, error = (sum(values) / len(known) for values in zip(*known, strict=True))
            lost = any(row["failed"] or row["loss"]["lost"] for row in rows)
            found.append(Point(name, cpu, 1e3 * error, lost))
    return found


def points_of(log: LogResult) -> list[Point]:
    """The same of one log."""
    from bench.results import Comparison

    return points(Comparison({}, [log], []))


def front(of: Sequence[Point]) -> list[Point]:
    """Of the points that were not lost, those with none both cheaper and more accurate."""
    found: list[Point] = []
    kept = (point for point in of if not point.lost)
    for point in sorted(kept, key=lambda point: (point.cpu_ms, point.error_mm)):
        if not found or point.error_mm < found[-1].error_mm:
            found.append(point)
    return found


def spread(at: Sequence[tuple[float, float]]) -> list[float]:
    """Heights at which the names of points are written so that none covers another.

    Places and heights are shares of the figure; a name stands right of its point, or, at the right
    edge, left of it.
    """
    heights: dict[int, float] = {}
    for k in sorted(range(len(at)), key=lambda k: at[k]):
        x, y = at[k]
        taken = [heights[j] for j in heights if abs(at[j][0] - x) < NAME_WIDTH]
        steps = (STEP * sign * n for n in range(len(at) + 1) for sign in (1.0, -1.0))
        places = (y + step for step in steps if LOWEST <= y + step <= HIGHEST)
        free = (up for up in places if all(abs(up - other) >= STEP for other in taken))
        heights[k] = next(free, y)
    return [heights[k] for k in range(len(at))]
