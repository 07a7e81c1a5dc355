"""Evaluation of a comparison: map quality, tests on each log and over all logs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from bench.judge import mapquality, verdicts
from bench.judge.consistency import disagreements
from bench.results import Comparison, Line, LogResult, Reference, Row
from slams.registry import BASELINES

if TYPE_CHECKING:
    from bench.results import Outcome


def evaluated(logs: list[LogResult], facts: Line) -> Comparison:
    """Evaluate all runs before anything is written."""
    judged = [_evaluated_log(log) for log in logs]
    every = [log.outcomes for log in judged]
    return Comparison(facts, judged, verdicts.over_logs(every) if len(judged) > 1 else [])


def _evaluated_log(log: LogResult) -> LogResult:
    found: Line = {
        "verdicts": verdicts.on_one_log(log.outcomes),
        "notes": [*log.entry["notes"], *_notes(log)],
    }
    # baselines do not count as the other runs of a disagreement
    others = [o for o in log.outcomes if len(o.t) and o.row["algorithm"] not in BASELINES]
    distances = disagreements([(o.t, o.poses) for o in others])
    known = dict(zip(map(id, others), distances, strict=True))
    outcomes = []
    for one in log.outcomes:
        more: Row = {"disagreement_m": known.get(id(one)), "map": _map_quality(one, log.reference)}
        outcomes.append(replace(one, row=one.row | more))
    return LogResult(log.reference._replace(entry=log.entry | found), outcomes)


def _map_quality(outcome: Outcome, reference: Reference) -> dict[str, float | None] | None:
    """Quality of the run's map; the true first pose transforms it into the world frame."""
    if outcome.grid is None or reference.grid is None or reference.start is None:
        return None
    T_world_map = reference.start @ outcome.frame.inverse()
    return mapquality.compare(outcome.grid, reference.grid, T_world_map)


def _notes(log: LogResult) -> list[str]:
    """A warning if relations have no stamps in the log."""
    found = [row["relations"] for row in log.rows if row.get("relations")]
    if not found:
        return []
    used, given = max(row["used"] for row in found if row), max(r["given"] for r in found if r)
    if used == 0:
        return [
            f"none of the {given} relations matches stamps of this log: are they another log's?"
        ]
    return [f"{used} of {given} relations have both stamps in the log"] if used < given else []
