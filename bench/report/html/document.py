"""The reports of a comparison: of one log, and over several of which each has its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from bench.judge import loss, metrics
from bench.report import tables, words
from bench.report import text as report
from bench.report.html import page
from bench.report.html.markup import Markup, bullets, element, together
from bench.report.html.page import table
from bench.report.html.record import facts, parameters
from bench.report.lines import Table

if TYPE_CHECKING:
    from bench.results import Comparison, LogResult

# tables that stand in sections of their own; the others are under "All tables"
MAIN, PAPER = ("main",), ("translation", "orientation", "published")
MAPS = (
    "Fig. 4 of the paper: white is free, black occupied, gray never observed. Each map with its "
    "path; dashed: the true one, where it is known."
)
SHARES = "Share of the poses with errors below a value: further left is better."
SHARES_OF_RUNS = (
    "Share of the runs with absolute errors below a value: further left and higher is better; a "
    "run that failed never comes."
)
PATHS = "Paths seen from the first pose; dashed: the true one, where it is known."


def write(folder: Path, comparison: Comparison, done: LogResult) -> None:
    """Write report.html of one log beside its figures in `folder`: all but the answer is folded."""
    entry, rows = done.entry, done.rows
    made = tables.tables(entry, rows)
    alone = comparison._replace(logs=[done], over_logs=[])
    shown = {
        "Which one": together(bullets(words.answer(alone)), _tables(made, MAIN)),
        "Maps": page.picture(folder / "fig4_maps.png", MAPS),
        "Errors": page.picture(folder / "fig_errors.png", f"{SHARES} {page.COSTS}"),
    }
    paper = [
        page.picture(
            folder / f"fig{number}_{kind}.png",
            f"Fig. {number} of the paper: error of {kind} per update, share of the updates.",
        )
        for number, kind in ((2, "translation"), (3, "orientation"))
    ]
    others = tuple(key for key in made if key not in (*MAIN, *PAPER))
    broken = words.failures(rows)
    sure = [verdict["sentence"] for verdict in words.neighbors(entry.get("verdicts") or [])]
    failed = bullets(broken) if broken else None
    folded = {
        "Tables and histograms of the paper": together(_tables(made, PAPER), *paper) or None,
        "Trajectories": page.picture(folder / "fig_trajectories.png", PATHS),
        "All tables": together(_tables(made, others), failed) or None,
        "How sure": bullets(sure) if sure else None,
        "How it was run": together(facts(comparison.as_dict(), entry), parameters(rows)),
        "Definitions": _definitions(),
    }
    title, heading = f"{entry['name']}: SLAM comparison", report.head(entry)
    page.write(folder, title, heading, shown, folded)


def write_joint(folder: Path, comparison: Comparison, folders: Sequence[str]) -> None:
    """Write report.html beside its figure; `folders` in it hold the logs' own."""
    over = [verdict["sentence"] for verdict in comparison.over_logs]
    shown = {
        "Which one": together(
            bullets(words.answer(comparison)),
            table(Table(tables.OVER_LOGS, tables.logs_table(comparison))),
        ),
        "Each log": _links(comparison, folders),
        "Errors": page.picture(folder / "fig_errors.png", f"{SHARES_OF_RUNS} {page.COSTS}"),
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
            f": {report.head(log.entry)}",
        )
        for log, folder in zip(comparison.logs, folders, strict=True)
    ]
    return element("ul", *lines)


def _tables(made: dict[str, Table], keys: tuple[str, ...]) -> Markup:
    return together(*(table(made[key]) for key in keys if key in made))


def _definitions() -> Markup:
    """The prose, with the constants of the code."""
    constants = {
        "limit_m": loss.LIMIT_M,
        "limit_rad": loss.LIMIT_RAD,
        "broken_share": 100 * loss.BROKEN_SHARE,
        "reported_share": 100 * loss.REPORTED_SHARE,
    }
    texts = {name: f"{value:g}" for name, value in constants.items()}
    texts["spans"] = ", ".join(metrics.SPANS[1:])
    return Markup(page.template("definitions.template.html").substitute(texts))
