"""The page over several logs: who is best over all of them; each log has a page of its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from bench.report import run_tables, tables, words
from bench.report import text as report
from bench.report.html import page
from bench.report.html.cells import table
from bench.report.html.markup import Markup, element, together
from bench.report.html.record import facts

if TYPE_CHECKING:
    from bench.results import Comparison


def write_joint(path: Path, comparison: Comparison, folders: Sequence[str]) -> None:
    """Write the page; `folders` beside it hold the logs' own."""
    path.write_text(joint(comparison, folders), encoding="utf-8", errors="replace")


def joint(comparison: Comparison, folders: Sequence[str]) -> str:
    """The page's text."""
    answer = (element("li", text) for text in words.answer(comparison))
    over = [element("li", verdict["sentence"]) for verdict in comparison.over_logs]
    before = {
        "Which one": element("ul", *answer),
        "Over all logs": table(run_tables.logs_table(comparison), tables.OVER_LOGS, {}),
        "How sure": element("ul", *over) if over else None,
        "Each log": _links(comparison, folders),
    }
    results = comparison.as_dict()
    behind = {"How it was run": facts(results, {})}
    title = f"SLAM comparison over {len(comparison.logs)} logs"
    return page.page(title, title, (before, {}, behind), [])


def _links(comparison: Comparison, folders: Sequence[str]) -> Markup:
    lines = [
        element("li", element("a", report.head(log.entry), href=f"{quote(folder)}/report.html"))
        for log, folder in zip(comparison.logs, folders, strict=True)
    ]
    return together(element("ul", *lines))
