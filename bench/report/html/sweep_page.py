"""The page of a sweep: the answers, survival curves with their bands, tables."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from bench.judge.answers import Analysis, Cell
from bench.report import sweep_figure, sweep_tables
from bench.report.html import page
from bench.report.html.cells import table
from bench.report.html.legend import Curve
from bench.report.html.markup import Markup, beside, element, together
from bench.report.html.svg import drawing, figure, look
from bench.results.sweep import Sweep

ANSWERS, TABLES, RECORD = "Which one to take", "Tables", "How it was run"
FOLDED = (RECORD,)


def document(sweep: Sweep, found: Analysis) -> str:
    """The page's text; same results, same bytes."""
    labels = dict.fromkeys(name for name, *_ in found.rows)
    shown = [Curve(f"run-{k}", label) for k, label in enumerate(labels)]
    answers = (table(one) for one in sweep_tables.choices(found))
    before = {ANSWERS: together(element("p", sweep_tables.TAKE), *answers)}
    made = sweep_tables.tables(found, sweep.facts).values()
    behind = {
        TABLES: together(*(table(one) for one in made)),
        RECORD: _record(sweep),
    }
    drawn = {"Runs that hold a level": _figures(found, sweep, shown)}
    heading = f"{sweep_tables.head(found, sweep.facts)}."
    parts = before, drawn, behind
    return page.page("SLAM in the field: what breaks it", heading, parts, shown, FOLDED)


def _figures(found: Analysis, sweep: Sweep, shown: Sequence[Curve]) -> Markup | None:
    """A figure per question and degradation, laser alone beside with odometry."""
    groups: dict[tuple[str, str], list[Cell]] = {}
    for cell in found.cells:
        if not cell.equal and len(cell.levels) > 1:
            groups.setdefault((cell.question, cell.title), []).append(cell)
    made = []
    for (question, name), cells in groups.items():
        meaning, unit = (sweep.facts[key].get(name, "") for key in ("meanings", "units"))
        drawn = beside(*(_plot(cell, unit, shown) for cell in cells))
        words = "share of the runs that hold the level, with its 95 % band"
        made.append(figure(f"{question}. {name} [{unit}]: {meaning}; {words}.", drawn))
    return together(*made) if made else None


def _plot(cell: Cell, unit: str, shown: Sequence[Curve]) -> Markup:
    label = f"{cell.title} [{unit}], {sweep_tables.MODES[cell.odometry]}"
    looks = {curve.name: look(curve.kind) for curve in shown if curve.name in cell.curves}
    draw = partial(sweep_figure.survival, cell=cell, label=label, looks=looks)
    return drawing(f"share of runs held, {label}", draw)


def _record(sweep: Sweep) -> Markup:
    """Command, machine and versions."""
    machine, versions = sweep.record["machine"], sweep.record["versions"]
    return together(
        element("p", element("code", sweep.record["command"])),
        element("p", f"CPU times: {machine['cpu']}, {machine['system']}, one thread for each run."),
        element("p", ", ".join(f"{name} {version}" for name, version in versions.items())),
    )
