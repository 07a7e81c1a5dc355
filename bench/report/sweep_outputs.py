"""Everything drawn from the results of a sweep: tables as csv and markdown, one page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bench.report import sweep_tables
from bench.report.text import markdown_table

if TYPE_CHECKING:
    from bench.results.sweep import Sweep


def write(folder: Path, sweep: Sweep) -> None:
    """Write all files but the results themselves."""
    from bench.report.html import sweep_page

    for name, made in sweep_tables.tables(sweep).items():
        made.frame.to_csv(folder / f"table-{name}.csv", index_label=made.corner)
    sweep_tables.trial_table(sweep).to_csv(folder / "trials.csv", index=False)
    (folder / "tables.md").write_text(as_markdown(sweep), encoding="utf-8")
    (folder / "report.html").write_text(sweep_page.document(sweep), encoding="utf-8")


def as_markdown(sweep: Sweep) -> str:
    """All tables and the answer, for a README."""
    parts = [f"{sweep_tables.head(sweep)}."]
    for made in sweep_tables.tables(sweep).values():
        parts += [f"**{made.title}**", markdown_table(made.frame, made.corner)]
    parts.append("\n".join(f"- {line}" for line in sweep_tables.verdict_lines(sweep)))
    parts.append("\n".join(f"- {line}" for line in sweep_tables.answer(sweep)))
    return "\n\n".join(part for part in parts if part) + "\n"
