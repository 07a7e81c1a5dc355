"""The page of a sweep: who survives, error and cost against level, tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from bench.judge.survival import CLEAN
from bench.report import sweep_tables
from bench.report.html import page
from bench.report.html.cells import table
from bench.report.html.markup import Markup, element, together
from bench.report.html.plots import Axis, figure, line, path, plot
from bench.results.sweep import Cost, Sweep, Trial

SPREAD = 0.12  # of a level between the first and the last algorithm's marks
LEAST = 0.1  # mm or ms/s: less is drawn as this


class Curve(NamedTuple):
    """An algorithm in the figures."""

    kind: str
    name: str


class Value(NamedTuple):
    """What is drawn over the levels: a figure of a trial that did not fail, or None."""

    title: str
    words: str
    of: Callable[[Trial, Cost | None], float | None]


def document(sweep: Sweep) -> str:
    """The page's text; same results, same bytes."""
    labels = dict.fromkeys(trial["algorithm"] for trial in sweep.trials)
    shown = [Curve(f"run-{k}", label) for k, label in enumerate(labels)]
    answer = element("ul", *(element("li", text) for text in sweep_tables.answer(sweep)))
    verdicts = [element("li", text) for text in sweep_tables.verdict_lines(sweep)]
    before = {
        "Which one": answer,
        "Tables": _tables(sweep),
        "How sure": element("ul", *verdicts) if verdicts else None,
    }
    drawn = {
        "Error against level": _errors(sweep, shown),
        "Cost against level": _costs(sweep, shown),
    }
    behind = {"How it was run": _record(sweep)}
    heading = f"{sweep_tables.head(sweep)}."
    return page.page("SLAM in the field: what breaks it", heading, (before, drawn, behind), shown)


def _tables(sweep: Sweep) -> Markup:
    made = sweep_tables.tables(sweep).values()
    return together(*(table(one.frame, one.title, {}, one.corner) for one in made))


def _errors(sweep: Sweep, shown: Sequence[Curve]) -> Markup | None:
    words = "Median absolute error over the drives; dots are single runs, squares those lost."
    return _figures(sweep, shown, Value("absolute error [mm]", words, _error_of))


def _costs(sweep: Sweep, shown: Sequence[Curve]) -> Markup | None:
    words = "CPU per second of log, median over the drives; squares are runs that were lost."
    return _figures(sweep, shown, Value("CPU per second of log [ms/s]", words, _cost_of))


def _error_of(trial: Trial, _: Cost | None) -> float | None:
    return 1e3 * trial["ate_m"]


def _cost_of(trial: Trial, cost: Cost | None) -> float | None:
    return None if cost is None else 1e3 * cost["cpu_s"] / trial["duration_s"]


def _figures(sweep: Sweep, shown: Sequence[Curve], value: Value) -> Markup | None:
    """A figure per degradation, laser alone beside with odometry."""
    names = [n for n in dict.fromkeys(t["degradation"] for t in sweep.trials) if n != CLEAN]
    made = [_figure(sweep, shown, value, name) for name in names]
    return together(*made) if made else None


def _figure(sweep: Sweep, shown: Sequence[Curve], value: Value, name: str) -> Markup:
    unit, meaning = sweep.facts["units"].get(name, ""), sweep.facts["meanings"].get(name, "")
    modes = dict.fromkeys(t["odometry"] for t in sweep.trials if t["degradation"] == name)
    plots = [_plot(sweep, shown, value, name, odometry) for odometry in modes]
    drawn = element("div", *(made for made in plots if made), class_="pair")
    return figure(f"{name} [{unit}]: {meaning}. {value.words}", drawn)


def _plot(
    sweep: Sweep, shown: Sequence[Curve], value: Value, name: str, odometry: bool
) -> Markup | None:
    """Values over the levels of one degradation, the clean logs first."""
    values = {
        k: math.log10(max(found, LEAST))
        for k, (trial, cost) in enumerate(zip(sweep.trials, sweep.costs, strict=True))
        if trial["odometry"] == odometry and trial["degradation"] in (CLEAN, name)
        if not trial["failed"] and (found := value.of(trial, cost)) is not None
    }
    if not values:
        return None
    levels = list(dict.fromkeys(_level(sweep.trials[k]) for k in values))
    marks = tuple((float(i), "clean" if v is None else f"{v:g}") for i, v in enumerate(levels))
    unit = sweep.facts["units"].get(name, "")
    x = Axis(
        f"{name} [{unit}], {sweep_tables.MODES[odometry]}", -0.4, len(levels) - 0.6, marks=marks
    )
    y = Axis(value.title, min(values.values()) - 0.1, max(values.values()) + 0.1, log=True)
    drawn: list[Markup] = []
    for i, curve in enumerate(shown):
        aside = SPREAD * (i / max(len(shown) - 1, 1) - 0.5)
        own = [k for k in values if sweep.trials[k]["algorithm"] == curve.name]
        drawn += _curve(sweep, own, values, levels, aside, (x, y), curve)
    return plot(f"{value.title}, {x.label}", x, y, drawn, zoom="")


def _curve(
    sweep: Sweep,
    own: list[int],
    values: dict[int, float],
    levels: list[float | None],
    aside: float,
    axes: tuple[Axis, Axis],
    curve: Curve,
) -> list[Markup]:
    """The medians as a line, single runs as marks."""
    place = {k: levels.index(_level(sweep.trials[k])) + aside for k in own}
    at = sorted(set(place.values()))
    medians = [float(np.median([values[k] for k in own if place[k] == x])) for x in at]
    kind = f"{curve.kind} mark"
    drawn = [line(np.array(at), np.array(medians), axes, kind, curve.name)] if at else []
    for k in own:
        trial = sweep.trials[k]
        where = path(np.array([place[k]]), np.array([values[k]]), axes) + "h0"
        words = f"{curve.name}, {trial['log']}, {'lost' if trial['lost'] else 'kept its way'}"
        shape = "cross" if trial["lost"] else "dot"
        drawn.append(element("path", element("title", words), class_=f"{shape} {kind}", d=where))
    return drawn


def _level(trial: Trial) -> float | None:
    """The level; None for the clean log, which stands before all levels."""
    return None if trial["degradation"] == CLEAN else trial["level"]


def _record(sweep: Sweep) -> Markup:
    """Command, machine and versions."""
    machine, versions = sweep.record["machine"], sweep.record["versions"]
    return together(
        element("p", element("code", sweep.record["command"])),
        element("p", f"CPU times: {machine['cpu']}, {machine['system']}, one thread for each run."),
        element("p", ", ".join(f"{name} {version}" for name, version in versions.items())),
    )
