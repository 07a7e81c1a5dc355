"""The comparison in words: who is best and how far from possible, who failed, what it costs."""

from __future__ import annotations

from typing import Any, NamedTuple

from bench.judge.verdicts import SPANS
from bench.report import text as report
from bench.report.tables import BOUND, Line, Rows, label
from slams.registry import BASELINES


class Ranked(NamedTuple):
    """A run that kept its way and its mean errors [m], [rad]."""

    name: str
    translation: float
    rotation: float


def summary(entry: Line, rows: Rows) -> list[str]:
    """One paragraph about a log, as sentences."""
    done = [row for row in rows if not row["failed"]]
    return [*_accuracy(entry, done), *_failures(rows, done), *_cost(done)]


def over_what(rows: Rows) -> str | None:
    """The span that decides: 1 s, where the log has it."""
    judged = [row["errors"]["spans"] for row in rows if not row["failed"] and row["errors"]]
    shared = (span for span in SPANS if judged and all(span in spans for spans in judged))
    return next(shared, None)


def _accuracy(entry: Line, rows: Rows) -> list[str]:
    span = over_what(rows)
    if span is None:
        return _by_relations(rows)
    ranked = sorted((_means(row, span) for row in rows if _kept(row)), key=lambda r: r.translation)
    if not ranked:
        return ["No run kept its way, so none is the best."]
    best, limit = ranked[0], (entry.get("bound") or {}).get("spans", {}).get(span)
    first = f"{best.name} is the most accurate: its mean error {SPANS[span]} is {_errors(best)}"
    if limit:
        first += f", {_multiples(best, limit)} times the {BOUND} of {_errors(_as_ranked(limit))}"
    return [f"{first}.", *_followers(ranked[1:], limit), *_how_sure(entry, best)]


def _followers(others: list[Ranked], limit: Line | None) -> list[str]:
    if not others:
        return []
    words = [
        f"{run.name} with {_mm(run.translation)}"
        + (f" ({run.translation / limit['translation_m']:.1f} times the bound)" if limit else "")
        for run in others
    ]
    return [f"It is followed by {_listed(words)}."]


def _how_sure(entry: Line, best: Ranked) -> list[str]:
    """The verdict on the best and the one next to it."""
    for verdict in report.neighbors(entry.get("verdicts") or []):
        if verdict["measure"] == "translation" and best.name in (verdict["a"], verdict["b"]):
            return [f"{verdict['sentence'].partition(': ')[2]}."]
    return []


def _by_relations(rows: Rows) -> list[str]:
    """The order by the log's relations, where it has no truth."""
    known = {
        label(row): row["relations"]["all"] for row in rows if "all" in (row["relations"] or {})
    }
    if not known:
        return ["The log has neither truth nor relations: nothing is known of the errors."]
    order = sorted(known, key=lambda name: float(known[name]["translation_m"]["mean"]))
    errors = {name: _mm(known[name]["translation_m"]["mean"]) for name in order}
    best = f"By the log's relations {order[0]} is the most accurate: {errors[order[0]]} mean error"
    others = [f"{name} with {errors[name]}" for name in order[1:]]
    return [best + (f", followed by {_listed(others)}." if others else ".")]


def _failures(rows: Rows, done: Rows) -> list[str]:
    sentences = [f"{line}." for line in report.failures(rows)]
    sentences += [_lost(row) for row in done if row["loss"]["lost"]]
    return sentences or ["No run failed, none was lost."]


def _lost(row: Line) -> str:
    verdict = row["loss"].get(row["loss"]["by"]) or {}
    words = f"{row['algorithm']} was lost"
    if verdict.get("at_s") is not None:
        words += f" after {report.cell('[s]', verdict['at_s'])} s"
    if verdict.get("after_m") is not None:
        words += f" and {report.cell('after [m]', verdict['after_m'])} m"
    return f"{words}."


def _cost(rows: Rows) -> list[str]:
    """The fastest algorithm, the baselines aside, and who is too slow for the log."""
    own = [row for row in rows if row["algorithm"].partition("@")[0] not in BASELINES] or rows
    if not own:
        return []
    fastest = min(own, key=lambda row: float(row["cost"]["mean_ms"]))
    cost = fastest["cost"]
    words = (
        f"{label(fastest)} is the fastest with {report.cell('[ms]', cost['mean_ms'])} ms per scan"
    )
    slow = [label(row) for row in rows if 0.0 < row["cost"]["real_time_factor"] < 1.0]
    too = (
        f"slower than the scans came: {_listed(slow)}"
        if slow
        else "every run kept up with the scans"
    )
    return [f"{words} on one core; {too}."]


def _kept(row: Line) -> bool:
    return bool(row["errors"]) and not row["loss"]["lost"]


def _means(row: Line, span: str) -> Ranked:
    errors = row["errors"]["spans"][span]
    translation, rotation = errors["se2_translation_m"], errors["orientation_rad"]
    return Ranked(row["algorithm"], float(translation["mean"]), float(rotation["mean"]))


def _as_ranked(limit: dict[str, Any]) -> Ranked:
    return Ranked(BOUND, float(limit["translation_m"]), float(limit["rotation_rad"]))


def _errors(run: Ranked) -> str:
    return f"{_mm(run.translation)} and {report.cell('[mrad]', 1e3 * run.rotation)} mrad"


def _mm(meters: float) -> str:
    return f"{report.cell('[mm]', 1e3 * meters)} mm"


def _multiples(run: Ranked, limit: Line) -> str:
    shares = (run.translation / limit["translation_m"], run.rotation / limit["rotation_rad"])
    return " and ".join(f"{share:.1f}" for share in shares)


def _listed(words: list[str]) -> str:
    """a, b and c."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
