"""The answer in words: which one to take, what else is as good, what is lost or too slow."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from bench.judge.verdicts import SIGNIFICANT
from bench.report import unaided
from bench.report.lines import deciding_error, listed
from bench.report.numbers import cell
from bench.results import Line, Row, Rows
from slams.registry import BASELINES

if TYPE_CHECKING:
    from bench.results import Comparison

SAME = 1.25  # times the least error is the same accuracy, if chance may make the difference


class Candidate(NamedTuple):
    """An algorithm over all logs: how many runs were lost or failed, mean error [m], CPU [ms].

    The error is that over 1 s, or of the relations; None where there is neither. CPU is None where
    nobody measured it.
    """

    name: str
    lost: int
    error: float | None
    cpu_ms: float | None


def answer(comparison: Comparison) -> list[str]:
    """Which one to take, on what grounds, and what else there is to know; a sentence each."""
    every = [_candidate(name, rows) for name, rows in by_algorithm(comparison).items()]
    own = [one for one in every if one.name.partition("@")[0] not in BASELINES] or every
    least = min((one.lost for one in own), default=0)
    kept = [one for one in own if one.lost == least]
    if not kept or (least == len(comparison.logs) and not any(one.error for one in kept)):
        return ["Every algorithm was lost or failed: none can be recommended here."]
    if all(one.error is None for one in kept):
        return unaided.answer(comparison, {one.name for one in kept})
    return [*_take(comparison, kept), *_lost(comparison), *_slow(comparison.rows)]


def by_algorithm(comparison: Comparison) -> dict[str, Rows]:
    """The rows of each algorithm, a row for each log."""
    found: dict[str, Rows] = {}
    for row in comparison.rows:
        found.setdefault(row["algorithm"], []).append(row)
    return found


def failures(rows: Rows) -> list[str]:
    """A sentence for each run that ended early."""
    return [f"{row['algorithm']} failed: {row['failed']}" for row in rows if row["failed"]]


def neighbors(verdicts: list[Line]) -> list[Line]:
    """Of all pairs, those of algorithms that follow one another in the order of their errors."""
    return [verdict for verdict in verdicts if verdict["next"]]


def _candidate(name: str, rows: Rows) -> Candidate:
    whole = [row for row in rows if not row["failed"]]
    lost = len(rows) - sum(not row["loss"]["lost"] for row in whole)
    errors = [error for row in whole if (error := deciding_error(row)) is not None]
    times = [row["cost"]["mean_ms"] for row in whole if row["cost"]]
    return Candidate(name, lost, _mean(errors), _mean(times))


def _take(comparison: Comparison, kept: list[Candidate]) -> list[str]:
    """The most accurate; of those as accurate within chance the cheapest."""
    judged = sorted((one for one in kept if one.error is not None), key=lambda one: one.error or 0)
    best = judged[0]
    equal = [best, *(one for one in judged[1:] if _alike(comparison, best, one))]
    taken = min(equal, key=lambda one: float("inf") if one.cpu_ms is None else one.cpu_ms)
    over = "over 1 s" if _has_truth(comparison) else "by the relations"
    what = f"{_mm(taken.error)} {over}{_cost(taken)}"
    others = [one.name for one in equal if one is not taken]
    verb = "Take" if not taken.lost else "The most accurate all the same is"
    words = [f"{verb} {taken.name}: {what}."]
    if others:
        words.append(f"As accurate within chance, and dearer: {listed(others)}.")
    behind = [one for one in judged if one not in equal]
    if behind:
        words.append(
            f"Next: {listed([f'{one.name} {_mm(one.error)}{_cost(one)}' for one in behind[:3]])}."
        )
    if kept[0].lost:
        words.insert(0, f"Every algorithm was lost on {kept[0].lost} of {_logs(comparison)}.")
    return words


def _alike(comparison: Comparison, best: Candidate, other: Candidate) -> bool:
    """Whether chance may make the difference of two in translation, and it is a small one."""
    if (other.error or 0.0) > SAME * (best.error or 0.0):
        return False  # a log too short to prove anything proves no equality
    several = len(comparison.logs) > 1
    found = comparison.over_logs if several else comparison.logs[0].entry.get("verdicts") or []
    for verdict in found:
        if {verdict["a"], verdict["b"]} == {best.name, other.name} and verdict[
            "measure"
        ] == "translation":
            p_value = verdict["p_value"]
            return not (p_value is not None and p_value < SIGNIFICANT)
    return False


def _lost(comparison: Comparison) -> list[str]:
    """The algorithms that were lost or failed, on how many logs, on one log when."""
    words = []
    for name, rows in by_algorithm(comparison).items():
        lost = [row for row in rows if row["failed"] or row["loss"]["lost"]]
        if lost and len(comparison.logs) == 1:
            words.append(f"{name}{_when(lost[0])}")
        elif lost:
            words.append(f"{name} on {len(lost)} of {len(rows)} logs")
    return [f"Lost or failed: {listed(words)}."] if words else []


def _when(row: Row) -> str:
    if row["failed"]:
        return " (failed)"
    at = (row["loss"].get(row["loss"]["by"]) or {}).get("at_s")
    return "" if at is None else f" after {at:.0f} s"


def _slow(rows: Rows) -> list[str]:
    """The algorithms for which the scans came too fast."""
    costs = [(row["algorithm"], row.get("cost") or {}) for row in rows]
    slow = dict.fromkeys(name for name, cost in costs if 0 < cost.get("real_time_factor", 0) < 1)
    return [f"Slower than the scans came: {listed([*slow])}."] if slow else []


def _has_truth(comparison: Comparison) -> bool:
    return any(row["errors"] for row in comparison.rows if not row["failed"])


def _logs(comparison: Comparison) -> str:
    return "1 log" if len(comparison.logs) == 1 else f"{len(comparison.logs)} logs"


def _cost(one: Candidate) -> str:
    return "" if one.cpu_ms is None else f", {cell('[ms]', one.cpu_ms)} ms per scan"


def _mm(meters: float | None) -> str:
    return f"{cell('[mm]', 1e3 * (meters or 0.0))} mm"


def _mean(values: list[float]) -> float | None:
    return sum(values) / len(values) if values else None
