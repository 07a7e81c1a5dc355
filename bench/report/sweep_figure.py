"""Figures of a sweep: survival curves, share of runs below an error, error against CPU."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bench.judge.answers import Analysis, Cell, questions
from bench.judge.survival import errors, survived
from bench.report.figures import plain_numbers, shares_below
from bench.report.palette import Look, looks
from bench.report.pareto import Point, front
from bench.report.sweep_tables import MODES
from bench.results.sweep import CLEAN, Sweep
from slams.types import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MODE_LINE_STYLES = {False: "--", True: "-"}  # laser alone, with odometry
BEAM_DEGRADATION = "beams"  # its levels are shown in the panels of costs
PANEL_SIZE = (4.6, 4.2)  # inches
CURVE_SPREAD = 0.12  # levels between the first and the last curve, so that equal ones are visible


def draw(sweep: Sweep, found: Analysis, path: Path) -> None:
    """Top: a panel of curves for each question. Bottom: one of costs for each choice of sensors."""
    names = list(dict.fromkeys(name for name, *_ in found.rows))
    color_of = {name: look.color for name, look in looks(names).items()}
    asked = questions(names)
    modes = sorted({odometry for _, odometry, _ in found.rows})
    columns = max(len(asked), len(modes))
    figure = Figure(figsize=(PANEL_SIZE[0] * columns, 2.0 * PANEL_SIZE[1]), layout="constrained")
    panels = figure.subplots(2, columns, squeeze=False)
    for axes in (*panels[0, len(asked) :], *panels[1, len(modes) :]):
        axes.set_visible(False)
    for axes, (question, rows) in zip(panels[0], asked.items(), strict=False):
        both = {f"{name}, {MODES[mode]}": (name, mode) for name in rows for mode in modes}
        values = {label: 1e3 * errors_of(sweep, *one) for label, one in both.items()}
        lines = MODE_LINE_STYLES
        styles = {label: Look(color_of[name], lines[mode]) for label, (name, mode) in both.items()}
        shares_below(axes, values, "error over 1 s", styles)
        axes.set(ylim=(0.0, 1.0), title=question)
    for axes, mode in zip(panels[1], modes, strict=False):
        _draw_costs(axes, sweep, found, mode, color_of)
    for axes in panels.ravel():
        axes.title.set_fontsize(9)
        axes.grid(visible=True, which="both", alpha=0.25)
    FigureCanvasAgg(figure).print_figure(path, dpi=110, metadata={"Software": None})


def draw_survival(found: Analysis, units: Mapping[str, str], folder: Path) -> None:
    """Survival curves by degradation and choice of sensors; a png for each question."""
    for k, question in enumerate(dict.fromkeys(cell.question for cell in found.cells)):
        own = [cell for cell in found.cells if cell.question == question]
        shown = [cell for cell in own if not cell.equal and len(cell.levels) > 1]
        if not shown:
            continue
        titles = list(dict.fromkeys(cell.title for cell in shown))
        modes = sorted({cell.odometry for cell in shown})
        size = PANEL_SIZE[0] * len(modes), 0.8 * PANEL_SIZE[1] * len(titles)
        figure = Figure(figsize=size, layout="constrained")
        figure.suptitle(question, fontsize=10)
        panels = figure.subplots(len(titles), len(modes), squeeze=False)
        for axes in panels.ravel():
            axes.set_visible(False)
        for cell in shown:
            axes = panels[titles.index(cell.title), modes.index(cell.odometry)]
            axes.set_visible(True)
            label = f"{cell.title} [{units.get(cell.title, '')}], {MODES[cell.odometry]}"
            survival(axes, cell, label)
        FigureCanvasAgg(figure).print_figure(
            folder / f"fig_survival-{k + 1}.png", dpi=110, metadata={"Software": None}
        )


def survival(axes: Axes, cell: Cell, label: str) -> None:
    """Share of the runs of each row that hold each level, with its 95 % band."""
    for k, (name, look) in enumerate(looks([*cell.curves]).items()):
        shares = cell.curves[name]
        x = np.arange(len(shares)) + CURVE_SPREAD * (k / max(len(cell.curves) - 1, 1) - 0.5)
        low, high = [one.low for one in shares], [one.high for one in shares]
        axes.fill_between(x, low, high, color=look.color, alpha=0.13, linewidth=0.0)
        held = [one.k / one.n for one in shares]
        axes.plot(x, held, look.line, color=look.color, label=name)
    axes.set_xticks(range(len(cell.levels)), [f"{level:g}" for level in cell.levels])
    axes.set(xlabel=label, ylabel="share of runs held", ylim=(-0.03, 1.03))
    axes.grid(visible=True, alpha=0.25)
    axes.legend(loc="lower left", fontsize=7)


def errors_of(sweep: Sweep, name: str, odometry: bool) -> Floats:
    """Errors over 1 s (n,) [m] of all runs of a row; inf for lost runs and harder levels."""
    levels = sweep.facts["levels"]
    own = [t for t in sweep.trials if (t["algorithm"], t["odometry"]) == (name, odometry)]
    climbs = {(t["log"], t["seed"], t["degradation"]) for t in own}
    runs = sum(len(levels[degradation]) for *_, degradation in climbs)
    known = [*errors(own, odometry, levels).get(name, {}).values()]
    return np.array(known + [np.inf] * (max(runs, 1) - len(known)))


def costs(sweep: Sweep, name: str, odometry: bool, degradation: str) -> list[Point]:
    """Median cost and error of a row at each level that at least half of its drives held.

    Fewer drives would not be representative: only the easy ones hold a hard level.
    """
    found: dict[float, list[tuple[float, float]]] = {}
    drives = set()
    wanted = name, odometry, degradation
    for trial, cost in zip(sweep.trials, sweep.costs, strict=True):
        if (trial["algorithm"], trial["odometry"], trial["degradation"]) == wanted:
            drives.add((trial["log"], trial["seed"]))
            if survived(trial) and trial["second_m"] and cost:
                one = 1e3 * cost["cpu_s"] / trial["scans"], 1e3 * trial["second_m"]
                found.setdefault(trial["level"], []).append(one)
    kept = {level: held for level, held in found.items() if 2 * len(held) >= len(drives)}
    middles = {level: np.median(held, axis=0).tolist() for level, held in kept.items()}
    return [Point(f"{level:g}", cpu, error, lost=0) for level, (cpu, error) in middles.items()]


def _draw_costs(
    axes: Axes, sweep: Sweep, found: Analysis, odometry: bool, color_of: Mapping[str, str]
) -> None:
    """Each row without degradation, with its path to fewer beams, and the Pareto front.

    If the sweep has no drives without degradation, the points are medians over all runs.
    """
    levels = sweep.facts["levels"]
    title = "No degradation" if CLEAN in levels else "Runs that were not lost"
    title += ", dots: fewer beams" if BEAM_DEGRADATION in levels else ""
    axes.set(xscale="log", yscale="log", title=f"{title}; {MODES[odometry]}")
    places: list[Point] = []
    for name, mode, of in found.rows:
        if mode != odometry:
            continue
        own = costs(sweep, name, odometry, CLEAN)
        if CLEAN not in levels and of.cpu_scan and of.second_m:
            own = [Point(name, 1e3 * of.cpu_scan, 1e3 * of.second_m, lost=0)]
        fewer = costs(sweep, name, odometry, BEAM_DEGRADATION)
        axes.plot(*_places([*own, *fewer]), ".-", color=color_of[name], linewidth=0.6, markersize=4)
        axes.plot(*_places(own), "o", color=color_of[name])
        for point in fewer[-1:]:
            place = point.cpu_ms, point.error_mm
            axes.annotate(point.name, place, fontsize=6, color=color_of[name])
        places += own
    best = _places(front(places))
    axes.plot(*best, color="0.5", linewidth=2.5, alpha=0.4, label="Pareto front")
    axes.set(xlabel="CPU per scan [ms]", ylabel="error over 1 s [mm]")
    plain_numbers(axes.xaxis)
    plain_numbers(axes.yaxis)
    axes.legend(fontsize=7)


def _places(points: Sequence[Point]) -> tuple[list[float], list[float]]:
    return [point.cpu_ms for point in points], [point.error_mm for point in points]
