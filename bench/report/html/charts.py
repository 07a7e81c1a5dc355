"""The figures of a page: errors, cost, [Kuehn] Fig. 2 to 4, trajectories."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from bench.judge.metrics import ORIENTATION_CLASS, TRANSLATION_CLASS
from bench.report import figures
from bench.report.html.legend import Curve, Run
from bench.report.html.markup import Markup, beside, element
from bench.report.html.svg import MAP, drawing, figure, look
from bench.report.pareto import Point

if TYPE_CHECKING:
    from bench.results import LogResult
    from slams.types import Floats

TRUE_MAP = "true map"


def errors(shown: Sequence[Run], span: str) -> Markup | None:
    """Shares of the poses with errors below a value, a curve for each run."""
    judged = [run for run in shown if span in run.outcome.errors]
    values = {run.name: 1e3 * run.outcome.errors[span].se2_translation for run in judged}
    over = "per update" if span == "update" else f"over {span}"
    words = f"Share of the poses whose error {over} is below a value: further left is better."
    return _shares(f"error of translation {over}", words, values, judged)


def over_runs(found: Mapping[str, Sequence[float]], shown: Sequence[Curve]) -> Markup | None:
    """Shares of the runs with absolute errors [mm] below a value, a curve for each algorithm."""
    words = (
        "Share of the runs whose absolute error is below a value: further left and higher is "
        "better; a run that failed never comes."
    )
    values = {name: np.array(own) for name, own in found.items() if np.isfinite(own).any()}
    return _shares("absolute error", words, values, shown)


def against_cost(points: Sequence[Point], kinds: Mapping[str, str]) -> Markup | None:
    """Error against CPU time on logarithmic axes; a line along those that none beats in both."""
    if not points:
        return None
    looks = {name: look(kind) for name, kind in kinds.items()}
    return figure(
        "Mean error against CPU time per scan, both logarithmic: lower left is better. The line "
        "joins those that no other beats in both; crosses were lost.",
        drawing(
            "error against CPU per scan",
            partial(figures.against_cost, points=points, looks=looks),
        ),
    )


def histograms(shown: Sequence[Run]) -> Markup | None:
    """[Kuehn] Fig. 2 and 3: shares of the updates in classes of error."""
    judged = {run: run.outcome.errors["update"] for run in shown if "update" in run.outcome.errors}
    if not judged:
        return None
    drawn = []
    for number, kind, most in (
        (2, "translation", TRANSLATION_CLASS),
        (3, "orientation", ORIENTATION_CLASS),
    ):
        values = {run.name: getattr(found, kind) for run, found in judged.items()}
        draw = partial(
            figures.histogram, errors=values, kind=kind, most=most, looks=_looks([*judged])
        )
        words = f"Fig. {number} of the paper: error of {kind} per update, share of the updates."
        drawn.append(figure(words, drawing(f"histogram: error of {kind} per update", draw)))
    return beside(*drawn)


def trajectories(shown: Sequence[Run], done: LogResult) -> Markup | None:
    """All paths in one plan, with the true one."""
    ways = {run: _seen_from_first(run) for run in shown if len(run.outcome.t)}
    if not ways:
        return None
    true = next((run.outcome.common.truth for run in ways if run.outcome.common), None)
    limits = figures.limits_of([true] if true is not None else _kept(ways), margin=1.0)
    paths = {run.name: way for run, way in ways.items()}
    draw = partial(
        figures.trajectories, paths=paths, truth=true, limits=limits, looks=_looks([*ways])
    )
    words = "this log has no truth" if true is None else "the dashed line is the true one"
    return figure(
        f"Paths seen from the first pose; {words}.",
        drawing("trajectories of all algorithms", draw),
    )


def maps(shown: Sequence[Run], done: LogResult) -> Markup | None:
    """[Kuehn] Fig. 4: the maps side by side in one scale, each with its path."""
    plans = {
        run: figures.Plan(run.outcome.grid, run.outcome.frame, run.outcome.poses)
        for run in shown
        if run.outcome.grid is not None
    }
    if not plans:
        return None
    start, known = done.reference.start, done.reference.grid
    truth = None if start is None else done.reference.path  # else in another frame than the maps
    ways = _kept({run: run.outcome.poses for run in plans})
    limits = figures.limits_of(ways if truth is None else [truth])
    panels = []
    if known is not None and start is not None:
        panels.append(_panel(TRUE_MAP, figures.Plan(known, start, None), truth, limits, ""))
    for run, plan in plans.items():
        panels.append(_panel(run.name, plan, truth, limits, run.kind))
    return figure(
        "Fig. 4 of the paper: white is free, black occupied, gray never observed (black and white "
        "change places on a dark page). Each map with its path"
        f"{' and, dashed, the true one' if truth is not None else ''}.",
        element("div", *panels, class_="maps"),
    )


def _panel(
    name: str, plan: figures.Plan, truth: Floats | None, limits: figures.Limits, kind: str
) -> Markup:
    own = look(kind) if kind else None
    draw = partial(figures.map_panel, name=name, plan=plan, truth=truth, limits=limits, look=own)
    drawn = drawing(f"map: {name}", draw, MAP)
    return element(
        "div", element("h3", name), drawn, class_=f"panel {kind} mark" if kind else "panel"
    )


def _shares(
    what: str, words: str, values: Mapping[str, Floats], shown: Sequence[Curve]
) -> Markup | None:
    if not values:
        return None
    draw = partial(figures.shares_below, errors=values, what=what, looks=_looks(shown))
    return figure(words, drawing(f"distribution: {what}", draw))


def _looks(shown: Sequence[Curve]) -> figures.Looks:
    return {run.name: look(run.kind) for run in shown}


def _seen_from_first(run: Run) -> Floats:
    """The path in the frame of the truth, where there is one."""
    common = run.outcome.common
    return run.outcome.poses if common is None else common.estimate


def _kept(ways: Mapping[Run, Floats]) -> list[Floats]:
    """The paths that set the shown part: none of lost runs, if there are others."""
    return [way for run, way in ways.items() if not run.lost] or list(ways.values())
