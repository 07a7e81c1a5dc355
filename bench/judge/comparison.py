"""A comparison weighed: maps against the true one, verdicts on each log and over all of them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from bench.judge import mapquality, verdicts
from bench.judge.consistency import disagreements
from bench.results import Comparison, Line, LogResult, Reference, Row
from slams.registry import BASELINES

if TYPE_CHECKING:
    from bench.results import Outcome


def weighed(logs: list[LogResult], facts: Line) -> Comparison:
    """Everything that follows from the runs; computed before anything is written."""
    judged = [_weighed_log(log) for log in logs]
    every = [outcome for log in judged for outcome in log.outcomes]
    return Comparison(facts, judged, verdicts.over_logs(every) if len(judged) > 1 else [])


def _weighed_log(log: LogResult) -> LogResult:
    found: Line = {
        "verdicts": verdicts.on_one_log(log.outcomes),
        "notes": [*log.entry["notes"], *_notes(log)],
    }
    # baselines are no witnesses of how far a run is from the others
    witnesses = [o for o in log.outcomes if len(o.t) and o.row["algorithm"] not in BASELINES]
    apart = disagreements([(o.t, o.poses) for o in witnesses])
    known = dict(zip(map(id, witnesses), apart, strict=True))
    outcomes = []
    for one in log.outcomes:
        more: Row = {"disagreement_m": known.get(id(one)), "map": _map_quality(one, log.reference)}
        outcomes.append(replace(one, row=one.row | more))
    return LogResult(log.reference._replace(entry=log.entry | found), outcomes)


def _map_quality(outcome: Outcome, reference: Reference) -> dict[str, float | None] | None:
    """The run's map against the true one, brought into the world by the true first pose."""
    if outcome.grid is None or reference.grid is None or reference.start is None:
        return None
    T_world_map = reference.start @ outcome.frame.inverse()
    return mapquality.compare(outcome.grid, reference.grid, T_world_map)


def _notes(log: LogResult) -> list[str]:
    """What the user ought to know of relations that matched nothing."""
    found = [row["relations"] for row in log.rows if row.get("relations")]
    if not found:
        return []
    used, given = max(row["used"] for row in found if row), max(r["given"] for r in found if r)
    if used == 0:
        return [
            f"none of the {given} relations matches stamps of this log: are they another log's?"
        ]
    return [f"{used} of {given} relations have both stamps in the log"] if used < given else []
