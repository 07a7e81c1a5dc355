"""Figures of a sweep: survival curves; share of its runs below an error, error against CPU."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bench.judge.answers import Analysis, Cell, questions
from bench.judge.survival import errors
from bench.report.figures import plain_numbers
from bench.report.palette import looks
from bench.report.pareto import Point, front
from bench.report.sweep_tables import MODES
from bench.results.sweep import Sweep
from slams.types import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINES, MARKERS = {False: "--", True: "-"}, {False: "o", True: "^"}  # laser alone, with odometry
PANEL = (4.6, 4.2)  # inches
SPREAD = 0.12  # of a level between the first and the last row's curve: equal ones stay visible


def draw(sweep: Sweep, found: Analysis, path: Path) -> None:
    """A panel of curves for each question, one of costs with the Pareto front; png."""
    names = list(dict.fromkeys(name for name, *_ in found.rows))
    color_of = {name: look.color for name, look in looks(names).items()}
    asked = questions(names)
    figure = Figure(figsize=(PANEL[0] * (len(asked) + 1), PANEL[1]), layout="constrained")
    *curves, costs = figure.subplots(1, len(asked) + 1)
    for axes, (question, rows) in zip(curves, asked.items(), strict=True):
        axes.set(xscale="log", ylim=(0.0, 1.0), title=question)
        for name in rows:
            for mode in sorted({odometry for row, odometry, _ in found.rows if row == name}):
                values, share = below(sweep, name, mode)
                label = f"{name}, {MODES[mode]}"
                axes.plot(1e3 * values, share, LINES[mode], color=color_of[name], label=label)
        axes.set(xlabel="error over 1 s [mm]", ylabel="share of all runs below")
        axes.legend(loc="lower right", fontsize=7)
    _draw_costs(costs, found, color_of)
    for axes in (*curves, costs):
        axes.title.set_fontsize(9)
        axes.grid(visible=True, which="both", alpha=0.25)
    FigureCanvasAgg(figure).print_figure(path, dpi=110, metadata={"Software": None})


def draw_survival(found: Analysis, units: Mapping[str, str], folder: Path) -> None:
    """Curves by degradation, laser alone beside with odometry; a png for each question."""
    for k, question in enumerate(dict.fromkeys(cell.question for cell in found.cells)):
        own = [cell for cell in found.cells if cell.question == question]
        shown = [cell for cell in own if not cell.equal and len(cell.levels) > 1]
        if not shown:
            continue
        titles = list(dict.fromkeys(cell.title for cell in shown))
        modes = sorted({cell.odometry for cell in shown})
        size = PANEL[0] * len(modes), 0.8 * PANEL[1] * len(titles)
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
        x = np.arange(len(shares)) + SPREAD * (k / max(len(cell.curves) - 1, 1) - 0.5)
        low, high = [one.low for one in shares], [one.high for one in shares]
        axes.fill_between(x, low, high, color=look.color, alpha=0.13, linewidth=0.0)
        held = [one.k / one.n for one in shares]
        axes.plot(x, held, look.line, color=look.color, label=name)
    axes.set_xticks(range(len(cell.levels)), [f"{level:g}" for level in cell.levels])
    axes.set(xlabel=label, ylabel="share of runs held", ylim=(-0.03, 1.03))
    axes.grid(visible=True, alpha=0.25)
    axes.legend(loc="lower left", fontsize=7)


def below(sweep: Sweep, name: str, odometry: bool) -> tuple[Floats, Floats]:
    """Errors over 1 s (n,) [m] of a row in order, and the share of its runs up to each.

    Lost runs, and levels behind the one that lost a run, count among all runs but have no error.
    """
    levels = sweep.facts["levels"]
    own = [t for t in sweep.trials if (t["algorithm"], t["odometry"]) == (name, odometry)]
    climbs = {(t["log"], t["seed"], t["degradation"]) for t in own}
    values = np.sort([*errors(own, odometry, levels).get(name, {}).values()])
    runs = sum(len(levels[degradation]) for *_, degradation in climbs)
    return values, np.arange(1.0, len(values) + 1.0) / max(runs, 1)


def _draw_costs(axes: Axes, found: Analysis, color_of: dict[str, str]) -> None:
    """Every row as a point, those of one choice of sensors with their Pareto front."""
    axes.set(xscale="log", yscale="log", title="Runs that were not lost, medians")
    for mode in sorted({odometry for _, odometry, _ in found.rows}):
        points = [
            Point(name, 1e3 * of.cpu_scan, 1e3 * of.second_m, lost=False)
            for name, odometry, of in found.rows
            if odometry == mode and of.cpu_scan and of.second_m
        ]
        for point in points:
            marker, color = MARKERS[mode], color_of[point.name]
            axes.plot(point.cpu_ms, point.error_mm, marker, color=color)
        best = front(points)
        label = f"Pareto front, {MODES[mode]}"
        x, y = [p.cpu_ms for p in best], [p.error_mm for p in best]
        axes.plot(x, y, LINES[mode], color="0.5", linewidth=0.8, label=label)
    axes.set(xlabel="CPU per scan [ms]", ylabel="error over 1 s [mm]")
    plain_numbers(axes.xaxis)
    plain_numbers(axes.yaxis)
    axes.legend(fontsize=7)
