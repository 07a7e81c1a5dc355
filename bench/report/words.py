"""The comparison in words: who is best and how far from possible, who failed, what it costs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from bench.judge.verdicts import SPANS
from bench.report.lines import BOUND, label, listed, sensors, spans_of
from bench.report.numbers import cell
from bench.results import Line, Row, Rows
from slams.registry import BASELINES

if TYPE_CHECKING:
    from bench.results import Comparison


class Ranked(NamedTuple):
    """A run that kept its way and its mean errors [m], [rad]."""

    name: str
    translation: float
    rotation: float


def summary(entry: Line, rows: Rows) -> list[str]:
    """One paragraph about a log, as sentences."""
    done = [row for row in rows if not row["failed"]]
    return [*_accuracy(entry, done), *_failures(rows, done), *_cost(done)]


def neighbors(verdicts: list[Line]) -> list[Line]:
    """Of all pairs, those of algorithms that follow one another in the order of their errors."""
    return [verdict for verdict in verdicts if verdict["next"]]


def failures(rows: Rows) -> list[str]:
    """A sentence for each run that ended early."""
    return [f"{row['algorithm']} failed: {row['failed']}" for row in rows if row["failed"]]


def answer(comparison: Comparison) -> list[str]:
    """Which one? The most accurate, the one that survives most, the cheapest that survives."""
    survived: dict[str, int] = {}
    for row in comparison.rows:
        kept = not row["failed"] and not row["loss"]["lost"]
        survived[row["algorithm"]] = survived.get(row["algorithm"], 0) + kept
    own = {name: n for name, n in survived.items() if name.partition("@")[0] not in BASELINES}
    most = max(own.values(), default=0)
    if not most:
        return ["Every algorithm was lost or failed: none can be recommended here."]
    best = [name for name, n in own.items() if n == most]
    return [
        *_most_accurate(comparison, best),
        *_survivors(comparison, own, most),
        *_cheapest(comparison, best),
    ]


def _most_accurate(comparison: Comparison, names: list[str]) -> list[str]:
    """Of those that survive most, by the mean over the logs of the error per second."""
    means: dict[str, list[float]] = {}
    used: dict[str, str | None] = {}
    for row in comparison.rows:
        error = _deciding_error(row)
        if row["algorithm"] in names and error is not None:
            means.setdefault(row["algorithm"], []).append(error)
            used[row["algorithm"]] = sensors(row)
    if not means:
        return []
    mean = {name: sum(values) / len(values) for name, values in means.items()}
    best = min(mean, key=lambda name: mean[name])
    what = f" ({used[best]})" if used[best] else ""
    over = (
        "over a second"
        if any(row["errors"] for row in comparison.rows if not row["failed"])
        else "by the relations"
    )
    return [f"Most accurate: {best}{what}, {_mm(mean[best])} {over}."]


def _survivors(comparison: Comparison, survived: dict[str, int], most: int) -> list[str]:
    logs = len(comparison.logs)
    best = [name for name, n in survived.items() if n == most]
    if len(best) == len(survived) and most == logs:
        return [f"Survives most: none was lost on {_counted(logs)}; the sweep tells them apart."]
    return [f"Survives most: {listed(best)}, {most} of {_counted(logs)}."]


def _counted(logs: int) -> str:
    return "this log" if logs == 1 else f"{logs} logs"


def _cheapest(comparison: Comparison, names: list[str]) -> list[str]:
    spent: dict[str, float] = {}
    for row in comparison.rows:
        if row["algorithm"] in names and not row["failed"] and row["cost"]:
            spent[row["algorithm"]] = spent.get(row["algorithm"], 0.0) + row["cost"]["mean_ms"]
    if not spent:
        return []
    best = min(spent, key=lambda name: spent[name])
    mean = spent[best] / len(comparison.logs)
    return [f"Cheapest of those: {best}, {cell('[ms]', mean)} ms per scan."]


def _deciding_error(row: Row) -> float | None:
    """The error over 1 s (or, in a log without truth, of its relations) [m]."""
    if row["failed"]:
        return None
    span = over_what([row])
    if span is not None:
        return _means(row, span).translation
    known = (row["relations"] or {}).get("all")
    return None if known is None else float(known["translation_m"]["mean"])


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
    return [f"It is followed by {listed(words)}."]


def _how_sure(entry: Line, best: Ranked) -> list[str]:
    """The verdict on the best and the one next to it."""
    for verdict in neighbors(entry.get("verdicts") or []):
        if verdict["measure"] == "translation" and best.name in (verdict["a"], verdict["b"]):
            return [f"{verdict['sentence'].partition(': ')[2]}."]
    return []


def _by_relations(rows: Rows) -> list[str]:
    """The order by the log's relations, where it has no truth."""
    found = ((label(row), (row["relations"] or {}).get("all")) for row in rows)
    known = {name: line for name, line in found if line is not None}
    if not known:
        return ["The log has neither truth nor relations: nothing is known of the errors."]
    order = sorted(known, key=lambda name: float(known[name]["translation_m"]["mean"]))
    errors = {name: _mm(known[name]["translation_m"]["mean"]) for name in order}
    best = f"By the log's relations {order[0]} is the most accurate: {errors[order[0]]} mean error"
    others = [f"{name} with {errors[name]}" for name in order[1:]]
    return [best + (f", followed by {listed(others)}." if others else ".")]


def _failures(rows: Rows, done: Rows) -> list[str]:
    sentences = [f"{line}." for line in failures(rows)]
    sentences += [_lost(row) for row in done if row["loss"]["lost"]]
    return sentences or ["No run failed, none was lost."]


def _lost(row: Row) -> str:
    verdict = row["loss"].get(row["loss"]["by"]) or {}
    words = f"{row['algorithm']} was lost"
    if verdict.get("at_s") is not None:
        words += f" after {cell('[s]', verdict['at_s'])} s"
    if verdict.get("after_m") is not None:
        words += f" and {cell('after [m]', verdict['after_m'])} m"
    return f"{words}."


def _cost(rows: Rows) -> list[str]:
    """The fastest algorithm, the baselines aside, and who is too slow for the log."""
    timed = [(row, row["cost"]) for row in rows if row["cost"]]
    own = [one for one in timed if one[0]["algorithm"].partition("@")[0] not in BASELINES] or timed
    if not own:
        return []
    fastest, cost = min(own, key=lambda one: float(one[1]["mean_ms"]))
    words = f"{label(fastest)} is the fastest with {cell('[ms]', cost['mean_ms'])} ms per scan"
    slow = [label(row) for row, cost in timed if 0.0 < cost["real_time_factor"] < 1.0]
    too = (
        f"slower than the scans came: {listed(slow)}"
        if slow
        else "every run kept up with the scans"
    )
    return [f"{words} on one core; {too}."]


def _kept(row: Row) -> bool:
    return bool(row["errors"]) and not row["loss"]["lost"]


def _means(row: Row, span: str) -> Ranked:
    errors = spans_of(row)[span]
    translation, rotation = errors["se2_translation_m"], errors["orientation_rad"]
    return Ranked(row["algorithm"], float(translation["mean"]), float(rotation["mean"]))


def _as_ranked(limit: dict[str, Any]) -> Ranked:
    return Ranked(BOUND, float(limit["translation_m"]), float(limit["rotation_rad"]))


def _errors(run: Ranked) -> str:
    return f"{_mm(run.translation)} and {cell('[mrad]', 1e3 * run.rotation)} mrad"


def _mm(meters: float) -> str:
    return f"{cell('[mm]', 1e3 * meters)} mm"


def _multiples(run: Ranked, limit: Line) -> str:
    shares = (run.translation / limit["translation_m"], run.rotation / limit["rotation_rad"])
    return " and ".join(f"{share:.1f}" for share in shares)
