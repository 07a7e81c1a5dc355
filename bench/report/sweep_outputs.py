"""Everything drawn from the results of a sweep: tables as csv, page, pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bench.judge.answers import Analysis, analysis
from bench.report import sweep_tables
from bench.report.text import write_csv

if TYPE_CHECKING:
    from bench.results.sweep import Sweep


def write(folder: Path, sweep: Sweep) -> Analysis:
    """Write all files but the results themselves; returns what they are made from."""
    from bench.report import sweep_figure
    from bench.report.html import sweep_page

    found = analysis(sweep)
    write_csv(folder, sweep_tables.tables(found, sweep.facts))
    sweep_tables.curve_table(found).to_csv(folder / "survival.csv", index=False)
    sweep_figure.draw(sweep, found, folder / "fig_sweep.png")
    sweep_figure.draw_survival(found, sweep.facts["units"], folder)
    sweep_page.write(folder, sweep, found)
    return found
