"""The reports of a comparison: one for each log, and one over several logs."""

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

# tables with their own sections; the others are under "All tables"
MAIN_TABLES, PAPER_TABLES = ("main",), ("translation", "orientation", "published")
MAPS_CAPTION = (
    "Fig. 4 of the paper: white is free, black occupied, gray unobserved. Each map has its path; "
    "the dashed path is the true one, if known."
)
POSES_CAPTION = "Share of the poses with errors below a value; left is better."
RUNS_CAPTION = (
    "Share of the runs with absolute errors below a value; left and high is better. Failed runs "
    "count as above every value."
)
PATHS_CAPTION = "Paths in the frame of the first pose; the dashed path is the true one, if known."


def write(folder: Path, comparison: Comparison, done: LogResult) -> None:
    """Write report.html of one log, beside its figures in `folder`; details are folded."""
    entry, rows = done.entry, done.rows
    made = tables.tables(entry, rows)
    alone = comparison._replace(logs=[done], over_logs=[])
    shown = {
        "Which one": together(bullets(words.answer(alone)), _tables(made, MAIN_TABLES)),
        "Maps": page.picture(folder / "fig4_maps.png", MAPS_CAPTION),
        "Errors": page.picture(folder / "fig_errors.png", f"{POSES_CAPTION} {page.COST_CAPTION}"),
    }
    paper = [
        page.picture(
            folder / f"fig{number}_{kind}.png",
            f"Fig. {number} of the paper: error of {kind} per update, share of the updates.",
        )
        for number, kind in ((2, "translation"), (3, "orientation"))
    ]
    others = tuple(key for key in made if key not in (*MAIN_TABLES, *PAPER_TABLES))
    broken = words.failures(rows)
    tests = [verdict["sentence"] for verdict in words.neighbors(entry.get("verdicts") or [])]
    failed = bullets(broken) if broken else None
    folded = {
        "Tables and histograms of the paper": together(_tables(made, PAPER_TABLES), *paper) or None,
        "Trajectories": page.picture(folder / "fig_trajectories.png", PATHS_CAPTION),
        "All tables": together(_tables(made, others), failed) or None,
        "Significance": bullets(tests) if tests else None,
        "How it was run": together(facts(comparison.as_dict(), entry), parameters(rows)),
        "Definitions": _definitions(),
    }
    title, heading = f"{entry['name']}: SLAM comparison", report.head(entry)
    page.write(folder, title, heading, shown, folded)


def write_joint(folder: Path, comparison: Comparison, folders: Sequence[str]) -> None:
    """Write report.html over several logs; `folders` contain the reports of each log."""
    over = [verdict["sentence"] for verdict in comparison.over_logs]
    shown = {
        "Which one": together(
            bullets(words.answer(comparison)),
            table(Table(tables.OVER_LOGS_TITLE, tables.logs_table(comparison))),
        ),
        "Each log": _links(comparison, folders),
        "Errors": page.picture(folder / "fig_errors.png", f"{RUNS_CAPTION} {page.COST_CAPTION}"),
    }
    folded = {
        "Significance": bullets(over) if over else None,
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
    """The text of the definitions, with the constants of the code."""
    constants = {
        "limit_m": loss.MAX_POSITION_ERROR,
        "limit_rad": loss.MAX_HEADING_ERROR,
        "broken_share": 100 * loss.MAX_BROKEN_SHARE,
        "reported_share": 100 * loss.MAX_REPORTED_SHARE,
    }
    texts = {name: f"{value:g}" for name, value in constants.items()}
    texts["spans"] = ", ".join(metrics.SPANS[1:])
    return Markup(page.template("definitions.template.html").substitute(texts))
