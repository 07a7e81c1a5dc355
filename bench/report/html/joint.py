"""The page over several logs: which one over all of them; each log has a page of its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from bench.report import tables, words
from bench.report import text as report
from bench.report.html import page
from bench.report.html.markup import Markup, bullets, element, together
from bench.report.html.page import table
from bench.report.html.record import facts
from bench.report.lines import Table

if TYPE_CHECKING:
    from bench.results import Comparison

SHARES = (
    "Share of the runs with absolute errors below a value: further left and higher is better; a "
    "run that failed never comes."
)


def write_joint(folder: Path, comparison: Comparison, folders: Sequence[str]) -> None:
    """Write report.html beside its figure; `folders` in it hold the logs' own."""
    over = [verdict["sentence"] for verdict in comparison.over_logs]
    shown = {
        "Which one": together(
            bullets(words.answer(comparison)),
            table(Table(tables.OVER_LOGS, tables.logs_table(comparison))),
        ),
        "Each log": _links(comparison, folders),
        "Errors": page.picture(folder / "fig_errors.png", f"{SHARES} {page.COSTS}"),
    }
    folded = {
        "How sure": bullets(over) if over else None,
        "How it was run": facts(comparison.facts),
    }
    title = f"SLAM comparison over {len(comparison.logs)} logs"
    page.write(folder, title, title, shown, folded)


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
