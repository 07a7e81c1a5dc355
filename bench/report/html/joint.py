"""The page over several logs: which one over all of them; each log has a page of its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from bench.report import pareto, tables, words
from bench.report import text as report
from bench.report.html import charts, page
from bench.report.html.cells import table
from bench.report.html.legend import Curve
from bench.report.html.markup import Markup, beside, bullets, element, together
from bench.report.html.record import facts
from bench.report.lines import Table

if TYPE_CHECKING:
    from bench.results import Comparison


def write_joint(path: Path, comparison: Comparison, folders: Sequence[str]) -> None:
    """Write the page; `folders` beside it hold the logs' own."""
    path.write_text(joint(comparison, folders), encoding="utf-8", errors="replace")


def joint(comparison: Comparison, folders: Sequence[str]) -> str:
    """The page's text."""
    over = [verdict["sentence"] for verdict in comparison.over_logs]
    shown = [Curve(f"run-{k}", name) for k, name in enumerate(comparison.by_algorithm())]
    kinds = {curve.name: curve.kind for curve in shown}
    before = {
        "Which one": together(
            bullets(words.answer(comparison)),
            table(Table(tables.OVER_LOGS, tables.logs_table(comparison)), kinds),
        ),
        "Each log": _links(comparison, folders),
    }
    errors = charts.over_runs(_errors(comparison), shown)
    costs = charts.against_cost(pareto.drawn(comparison), kinds)
    behind = {
        "How sure": bullets(over) if over else None,
        "How it was run": facts(comparison.as_dict(), {}),
    }
    title = f"SLAM comparison over {len(comparison.logs)} logs"
    drawn = {"Errors": beside(errors, costs)}
    return page.page(title, title, (before, drawn, behind), shown, set(behind))


def _errors(comparison: Comparison) -> dict[str, list[float]]:
    """Absolute errors [mm] of each algorithm's runs; inf where one failed or has none."""
    return {
        name: [
            float("inf") if row["failed"] or not row["errors"] else 1e3 * row["errors"]["ate_m"]
            for row in rows
        ]
        for name, rows in comparison.by_algorithm().items()
    }


def _links(comparison: Comparison, folders: Sequence[str]) -> Markup:
    """A link to each log's page, by the name of its folder."""
    lines = [
        element(
            "li",
            element("a", folder, href=f"{quote(folder)}/report.html"),
            f": {report.head(log.entry)}; odometry {_has(log.entry, 'odometry')}, "
            f"gyro {_has(log.entry, 'gyro')}",
        )
        for log, folder in zip(comparison.logs, folders, strict=True)
    ]
    return element("ul", *lines)


def _has(entry: dict[str, object], key: str) -> str:
    return "yes" if entry.get(key) else "no"
