"""The report of one log: the answer, one table, maps, curves; all the rest folded."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bench.judge import loss, metrics
from bench.report import pareto, tables, words
from bench.report import text as report
from bench.report.html import charts, page
from bench.report.html.cells import table
from bench.report.html.legend import runs
from bench.report.html.markup import Markup, beside, bullets, element, together
from bench.report.html.record import facts, parameters
from bench.report.lines import DECIDING_SPANS, Table, label

if TYPE_CHECKING:
    from bench.report.html.legend import Run
    from bench.results import Comparison, Line, LogResult, Rows

# tables that stand in sections of their own; the others are under "All tables"
MAIN, PAPER = ("main",), ("translation", "orientation", "published")


def write(path: Path, comparison: Comparison, done: LogResult) -> None:
    """Write the report of one log of a comparison; same results, same bytes."""
    path.write_text(document(comparison, done), encoding="utf-8", errors="replace")


def document(comparison: Comparison, done: LogResult) -> str:
    """The report's text."""
    results, entry, rows = comparison.as_dict(), done.entry, done.rows
    shown = runs(done)
    made = tables.tables(entry, rows)
    alone = comparison._replace(logs=[done], over_logs=[])
    before = {
        "Which one": together(bullets(words.answer(alone)), _tables(made, rows, MAIN)),
    }
    drawn = _figures(shown, done)
    paper = together(_tables(made, rows, PAPER), charts.histograms(shown))
    others = tuple(key for key in made if key not in (*MAIN, *PAPER))
    broken = words.failures(rows)
    failed = together(element("h3", "Failed"), bullets(broken)) if broken else None
    folded = {
        "Tables and histograms of the paper": paper or None,
        "Trajectories": charts.trajectories(shown, done),
    }
    behind = {
        "All tables": together(_tables(made, rows, others), failed) or None,
        "How sure": _verdicts(entry),
        "How it was run": together(facts(results, entry), parameters(rows)),
        "Definitions": _definitions(),
    }
    parts = (before, drawn | folded, behind)
    title, heading = f"{entry['name']}: SLAM comparison", report.head(entry)
    return page.page(title, heading, parts, shown, {*folded, *behind})


def _figures(shown: list[Run], done: LogResult) -> dict[str, Markup | None]:
    kinds = {run.outcome.row["algorithm"]: run.kind for run in shown}
    errors = charts.errors(shown, _span(shown))
    costs = charts.against_cost(pareto.drawn_of(done), kinds)
    return {"Maps": charts.maps(shown, done), "Errors": beside(errors, costs)}


def _span(shown: list[Run]) -> str:
    """The span that all runs with errors have."""
    judged = [run.outcome.errors for run in shown if run.outcome.errors]
    shared = (name for name in DECIDING_SPANS if all(name in found for found in judged))
    return next(shared, "update")


def _tables(made: dict[str, Table], rows: Rows, keys: tuple[str, ...]) -> Markup:
    kinds = {label(row): f"run-{k}" for k, row in enumerate(rows)}
    drawn = []
    for key in keys:
        if key in made:
            drawn.append(table(made[key], kinds))
            drawn += [element("p", tables.DIFFERS)] if key == "published" else []
    return together(*drawn)


def _verdicts(entry: Line) -> Markup | None:
    """The sentence of each pair: neighbors in the order of their errors first."""
    found: list[Line] = entry.get("verdicts") or []
    if not found:
        return None
    others = [verdict["sentence"] for verdict in found if not verdict["next"]]
    return together(
        bullets([verdict["sentence"] for verdict in words.neighbors(found)]),
        element("details", element("summary", "all other pairs"), bullets(others))
        if others
        else None,
    )


def _definitions() -> Markup:
    """The prose, with the constants of the code."""
    constants = {
        "loop_s": metrics.LOOP,
        "limit_m": loss.LIMIT_M,
        "limit_rad": loss.LIMIT_RAD,
        "broken_share": 100 * loss.BROKEN_SHARE,
        "reported_share": 100 * loss.REPORTED_SHARE,
    }
    texts = {name: f"{value:g}" for name, value in constants.items()}
    texts["spans"] = ", ".join(span.name for span in metrics.SPANS[1:])
    return Markup(page.template("definitions.template.html").substitute(texts))
