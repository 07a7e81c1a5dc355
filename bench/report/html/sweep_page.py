"""The page of a sweep: the answers, survival curves with their bands, tables."""

from __future__ import annotations

from pathlib import Path

from bench.judge.answers import Analysis
from bench.report import sweep_tables
from bench.report.html import page
from bench.report.html.markup import Markup, bullets, element, together
from bench.report.html.page import table
from bench.results.sweep import Sweep

RECORD = "How it was run"
HELD = "Share of the runs that hold the level, with its 95 % band."


def document(folder: Path, sweep: Sweep, found: Analysis) -> str:
    """The page's text, its figures lie in `folder`; same results, same bytes."""
    facts = sweep.facts
    answers = (table(one) for one in sweep_tables.choices(found))
    meanings = [f"{name} [{facts['units'][name]}]: {of}" for name, of in facts["meanings"].items()]
    curves = [page.picture(path, HELD) for path in sorted(folder.glob("fig_survival-*.png"))]
    sections = {
        "Which one to take": together(element("p", sweep_tables.TAKE), *answers),
        "Runs that hold a level": together(bullets(meanings), *curves) if curves else None,
        "Tables": together(*(table(one) for one in sweep_tables.tables(found, facts).values())),
        RECORD: _record(sweep),
    }
    heading = f"{sweep_tables.head(found, facts)}."
    return page.page("SLAM in the field: what breaks it", heading, sections, (RECORD,))


def _record(sweep: Sweep) -> Markup:
    """Command, machine and versions."""
    machine, versions = sweep.record["machine"], sweep.record["versions"]
    return together(
        element("p", element("code", sweep.record["command"])),
        element("p", f"CPU times: {machine['cpu']}, {machine['system']}, one thread for each run."),
        element("p", ", ".join(f"{name} {version}" for name, version in versions.items())),
    )
