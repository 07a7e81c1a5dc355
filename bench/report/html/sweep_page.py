"""The page of a sweep: the answers, survival curves with their bands, tables."""

from __future__ import annotations

from pathlib import Path

from bench.judge.answers import Analysis
from bench.report import sweep_tables
from bench.report.html import page, record
from bench.report.html.markup import bullets, element, together
from bench.report.html.page import table
from bench.results.sweep import Sweep

HELD = "Share of the runs that hold the level, with its 95 % band."


def write(folder: Path, sweep: Sweep, found: Analysis) -> None:
    """Write report.html of a sweep beside its figures in `folder`."""
    facts = sweep.facts
    answers = (table(one) for one in sweep_tables.choices(found))
    meanings = [f"{name} [{facts['units'][name]}]: {of}" for name, of in facts["meanings"].items()]
    curves = [page.picture(path, HELD) for path in sorted(folder.glob("fig_survival-*.png"))]
    shown = {
        "Which one to take": together(element("p", sweep_tables.TAKE), *answers),
        "Runs that hold a level": together(bullets(meanings), *curves) if curves else None,
        "Tables": together(*(table(one) for one in sweep_tables.tables(found, facts).values())),
    }
    heading = f"{sweep_tables.head(found, facts)}."
    folded = {"How it was run": record.facts(sweep.record)}
    page.write(folder, "SLAM in the field: what breaks it", heading, shown, folded)
