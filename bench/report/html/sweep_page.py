"""The page of a sweep: answers, errors and costs, survival curves, tables."""

from __future__ import annotations

from pathlib import Path

from bench.judge.answers import Analysis
from bench.report import sweep_tables
from bench.report.html import page, record
from bench.report.html.markup import bullets, element, together
from bench.report.html.page import table
from bench.results.sweep import Sweep

SWEEP_CAPTION = (
    "Top: share of all runs, at all levels, with errors below a value; a curve ends at the share "
    "that was not lost. Bottom: medians of the drives without degradation (large), then with fewer "
    "and fewer beams as long as half of the drives hold; lower left is better."
)
SURVIVAL_CAPTION = "Share of the runs that hold the level, with its 95 % band."


def write(folder: Path, sweep: Sweep, found: Analysis) -> None:
    """Write report.html of a sweep beside its figures in `folder`."""
    facts = sweep.facts
    answers = (table(one) for one in sweep_tables.choices(found))
    meanings = [f"{name} [{facts['units'][name]}]: {of}" for name, of in facts["meanings"].items()]
    files = sorted(folder.glob("fig_survival-*.png"))
    curves = [page.picture(path, SURVIVAL_CAPTION) for path in files]
    shown = {
        "Which one to take": together(element("p", sweep_tables.ANSWER_NOTE), *answers),
        "Errors and costs": page.picture(folder / "fig_sweep.png", SWEEP_CAPTION),
        "Runs that hold a level": together(bullets(meanings), *curves) if curves else None,
        "Tables": together(*(table(one) for one in sweep_tables.tables(found, facts).values())),
    }
    heading = f"{sweep_tables.head(found, facts)}."
    folded = {"How it was run": record.facts(sweep.record)}
    page.write(folder, "SLAM under degraded conditions", heading, shown, folded)
