"""The document: its sections in their order, each only if there is something to say."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bench.judge import loss, metrics
from bench.report import tables, words
from bench.report import text as report
from bench.report.html import charts, page, plans
from bench.report.html.cells import table
from bench.report.html.markup import Markup, element, together
from bench.report.html.record import facts, parameters
from bench.report.html.runs import runs
from bench.report.lines import label

if TYPE_CHECKING:
    from bench.report.html.runs import Run
    from bench.results import Comparison, Line, LogResult, Rows


def write(path: Path, comparison: Comparison, done: LogResult) -> None:
    """Write the report of one log of a comparison; same results, same bytes."""
    path.write_text(document(comparison, done), encoding="utf-8", errors="replace")


def document(comparison: Comparison, done: LogResult) -> str:
    """The report's text."""
    results, entry, rows = comparison.as_dict(), done.entry, done.rows
    shown = runs(done)
    found = {"Which one": _answer(comparison)} | _findings(results, entry, rows)
    drawn = _figures(entry, rows, shown, done)
    record = {
        "How it was run": together(facts(results, entry), parameters(rows)),
        "Definitions": _definitions(),
    }
    return page.page(
        f"{entry['name']}: SLAM comparison", report.head(entry), (found, drawn, record), shown
    )


def _answer(comparison: Comparison) -> Markup:
    """Three sentences over all logs of the comparison."""
    return element("ul", *(element("li", text) for text in words.answer(comparison)))


def _findings(results: Line, entry: Line, rows: Rows) -> dict[str, Markup | None]:
    return {
        "Summary": element("p", " ".join(words.summary(entry, rows))),
        "Tables": _tables(entry, rows),
        "How sure": _verdicts(results, entry),
    }


def _figures(entry: Line, rows: Rows, shown: list[Run], done: LogResult) -> page.Sections:
    bound = (entry.get("bound") or {}).get("spans", {})
    span = words.over_what(rows) or "update"
    return {
        "Errors": charts.histograms(shown, bound),
        "Trajectories": plans.trajectories(shown, done),
        "Maps": plans.maps(shown, done),
        "Errors over time": charts.over_time(shown, bound, span),
        "Cost per scan": charts.latency(shown),
    }


def _tables(entry: Line, rows: Rows) -> Markup:
    """The paper's tables, then the others; runs that ended early below."""
    kinds = {label(row): f"run-{k}" for k, row in enumerate(rows)}
    drawn = []
    for key, frame in tables.tables(entry, rows).items():
        drawn.append(table(frame, tables.TITLES[key], kinds))
        if key == "published":
            drawn.append(element("p", tables.DIFFERS))
    failed = [element("li", line) for line in words.failures(rows)]
    if failed:
        drawn += [element("h3", "Failed"), element("ul", *failed)]
    return together(*drawn)


def _verdicts(results: Line, entry: Line) -> Markup | None:
    """The sentence of each pair: neighbors in the order of their errors first."""
    found: list[Line] = entry.get("verdicts") or []
    over: list[Line] = results.get("over_logs") or []
    if not found and not over:
        return None
    return together(
        _sentences(words.neighbors(found)),
        _folded("all other pairs", [verdict for verdict in found if not verdict["next"]]),
        element("h3", "Over all logs of this comparison") if over else None,
        _sentences(over),
    )


def _sentences(found: list[Line]) -> Markup | None:
    lines = [element("li", verdict["sentence"]) for verdict in found]
    return element("ul", *lines) if lines else None


def _folded(title: str, found: list[Line]) -> Markup | None:
    return element("details", element("summary", title), _sentences(found)) if found else None


def _definitions() -> Markup:
    """The prose, with the constants of the code."""
    constants = {
        "loop_s": metrics.LOOP,
        "limit_m": loss.LIMIT_M,
        "limit_share": 100 * loss.LIMIT_SHARE,
        "limit_rad": loss.LIMIT_RAD,
        "broken_share": 100 * loss.BROKEN_SHARE,
        "reported_share": 100 * loss.REPORTED_SHARE,
    }
    texts = {name: f"{value:g}" for name, value in constants.items()}
    texts["spans"] = ", ".join(span.name for span in metrics.SPANS[1:])
    return Markup(page.template("definitions.template.html").substitute(texts))
