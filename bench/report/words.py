"""The answer in sentences: recommended and equal algorithms, lost and slow runs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bench.judge.answers import SAME_ACCURACY_RATIO
from bench.judge.statistics import SIGNIFICANCE_LEVEL
from bench.report import unaided
from bench.report.lines import DECIDING_SPANS, cell, deciding_span, is_lost, listed, value
from bench.report.pareto import Point, points
from bench.results import Line, Row, Rows
from slams.registry import BASELINES

if TYPE_CHECKING:
    from bench.results import Comparison


def answer(comparison: Comparison) -> list[str]:
    """The recommendation, its reason, and lost or slow runs; a sentence each."""
    every = points(comparison)
    own = [one for one in every if one.name.partition("@")[0] not in BASELINES] or every
    least = min((one.lost for one in own), default=0)
    kept = [one for one in own if one.lost == least]
    if not kept or (least == len(comparison.logs) and not any(one.error_mm > 0.0 for one in kept)):
        return ["Every algorithm was lost or failed: none can be recommended here."]
    if all(math.isnan(one.error_mm) for one in kept):
        return unaided.answer(comparison, {one.name for one in kept})
    return [*_take(comparison, kept), *_lost(comparison), *_slow(comparison.rows)]


def failures(rows: Rows) -> list[str]:
    """A sentence for each run that failed."""
    return [f"{row['algorithm']} failed: {row['failed']}" for row in rows if row["failed"]]


def neighbors(verdicts: list[Line]) -> list[Line]:
    """The pairs of algorithms that are neighbors in the order of their errors."""
    return [verdict for verdict in verdicts if verdict["next"]]


def _take(comparison: Comparison, kept: list[Point]) -> list[str]:
    """The most accurate algorithm; among equally accurate ones the cheapest."""
    known = [one for one in kept if not math.isnan(one.error_mm)]
    judged = sorted(known, key=lambda one: one.error_mm)
    best = judged[0]
    equal = [best, *(one for one in judged[1:] if _alike(comparison, best, one))]
    taken = min(equal, key=lambda one: math.inf if math.isnan(one.cpu_ms) else one.cpu_ms)
    spans = dict.fromkeys(deciding_span(log.rows) or "" for log in comparison.logs)
    over = [DECIDING_SPANS.get(span, "by the relations") for span in spans]
    what = f"{_mm(taken)} {listed(over, 'or')}{_cost(taken)}"
    others = [one.name for one in equal if one is not taken]
    verb = "Take" if not taken.lost else "The most accurate one is still"
    words = [f"{verb} {taken.name}: {what}."]
    if others:
        slower = "" if any(math.isnan(one.cpu_ms) for one in equal) else ", but slower"
        words.append(f"As accurate within chance{slower}: {listed(others)}.")
    behind = [one for one in judged if one not in equal]
    if behind:
        words.append(
            f"Next: {listed([f'{one.name} {_mm(one)}{_cost(one)}' for one in behind[:3]])}."
        )
    if kept[0].lost:
        logs = "1 log" if len(comparison.logs) == 1 else f"{len(comparison.logs)} logs"
        words.insert(0, f"Every algorithm was lost on {kept[0].lost} of {logs}.")
    return words


def _alike(comparison: Comparison, best: Point, other: Point) -> bool:
    """Whether the translation errors of two algorithms differ little and not significantly."""
    if other.error_mm > SAME_ACCURACY_RATIO * best.error_mm:
        return False  # on a short log even large differences are not significant
    several = len(comparison.logs) > 1
    found = comparison.over_logs if several else comparison.logs[0].entry.get("verdicts") or []
    for verdict in found:
        if {verdict["a"], verdict["b"]} == {best.name, other.name} and verdict[
            "measure"
        ] == "translation":
            p_value = verdict["p_value"]
            return not (p_value is not None and p_value < SIGNIFICANCE_LEVEL)
    return False


def _lost(comparison: Comparison) -> list[str]:
    """The lost or failed algorithms: number of logs, or on one log the time of the loss."""
    words = []
    for name, rows in comparison.by_algorithm().items():
        lost = [row for row in rows if is_lost(row)]
        if lost and len(comparison.logs) == 1:
            words.append(f"{name}{_when(lost[0])}")
        elif lost:
            words.append(f"{name} on {len(lost)} of {len(rows)} logs")
    return [f"Lost or failed: {listed(words)}."] if words else []


def _when(row: Row) -> str:
    if row["failed"]:
        return " (failed)"
    at = value(row, f"loss/{row['loss']['by']}/at_s")
    return "" if at is None else f" after {at:.0f} s"


def _slow(rows: Rows) -> list[str]:
    """The algorithms slower than real time."""
    costs = [(row["algorithm"], row.get("cost") or {}) for row in rows]
    slow = dict.fromkeys(name for name, cost in costs if 0 < cost.get("real_time_factor", 0) < 1)
    return [f"Slower than real time: {listed([*slow])}."] if slow else []


def _cost(one: Point) -> str:
    return "" if math.isnan(one.cpu_ms) else f", {cell('[ms]', one.cpu_ms)} ms per scan"


def _mm(one: Point) -> str:
    return f"{cell('[mm]', one.error_mm)} mm"
