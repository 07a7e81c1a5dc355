"""Everything drawn from the results of a sweep: tables as csv and markdown, one page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bench.report import sweep_tables
from bench.report.text import markdown_table

if TYPE_CHECKING:
    from bench.results.sweep import Sweep

MEASURED = ("cost", "survival")  # tables with times: never the same twice


def write(folder: Path, sweep: Sweep) -> None:
    """Write all files but the results themselves."""
    from bench.report.html import sweep_page

    for key, frame in sweep_tables.tables(sweep).items():
        frame.to_csv(folder / f"table-{key}.csv", index_label=corner(key))
    sweep_tables.trial_table(sweep).to_csv(folder / "trials.csv", index=False)
    (folder / "tables.md").write_text(as_markdown(sweep), encoding="utf-8")
    (folder / "report.html").write_text(sweep_page.document(sweep), encoding="utf-8")


def as_markdown(sweep: Sweep) -> str:
    """All tables and the answer, for a README."""
    parts = [f"{sweep_tables.head(sweep)}."]
    for key, frame in sweep_tables.tables(sweep).items():
        parts += [f"**{sweep_tables.TITLES[key]}**", markdown_table(frame, corner(key))]
    parts.append("\n".join(f"- {line}" for line in sweep_tables.verdict_lines(sweep)))
    parts.append("\n".join(f"- {line}" for line in sweep_tables.answer(sweep)))
    return "\n\n".join(part for part in parts if part) + "\n"


def corner(key: str) -> str:
    """What stands over the names of a table's lines."""
    return {"errors": "condition", "cost": "condition", "reach": "degradation"}.get(
        key, "algorithm"
    )
