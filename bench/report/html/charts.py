"""Errors and cost: shares below a value, error against CPU, [Kuehn] Fig. 2 and 3, over time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from bench.judge.metrics import ORIENTATION_CLASS, TRANSLATION_CLASS, SpanErrors, class_shares
from bench.report.figures import CLASSES, class_width
from bench.report.html.legend import Named
from bench.report.html.markup import Markup, element, together
from bench.report.html.plots import (
    Axis,
    Note,
    across,
    band,
    bar,
    envelope,
    figure,
    line,
    plot,
    thinned,
)
from bench.report.html.runs import Run
from bench.report.lines import BOUND
from bench.report.pareto import Point, front
from slams.types import Floats

STRETCHES, MEANS = 600, 200  # of time that an area and a line are made of
LEAST = 1e-4  # ms, mm or mrad; less is drawn as this
SECONDS = "time since the first scan [s]"
SHARE = Axis("share below", 0.0, 1.0)


class Measure(NamedTuple):
    """A series of errors; `width` is that of a class in the paper's figure, `limit` a bound's key.

    `base` is the unit of the values, `unit` a thousandth of it.
    """

    name: str
    values: Callable[[SpanErrors], Floats]
    width: float
    base: str
    unit: str
    limit: str


class Limit(NamedTuple):
    """A value that is marked in a plot."""

    value: float
    name: str


# the histograms are the paper's, of its errors; over time it is the motion by itself that counts
PAPER = (
    Measure("translation", lambda e: e.translation, TRANSLATION_CLASS, "m", "mm", "translation_m"),
    Measure(
        "orientation", lambda e: e.orientation, ORIENTATION_CLASS, "rad", "mrad", "rotation_rad"
    ),
)
MOTION = (PAPER[0]._replace(values=lambda e: e.se2_translation), PAPER[1]._replace(name="rotation"))


def errors(shown: Sequence[Run], bound: dict[str, Any], span: str) -> Markup | None:
    """Shares of the poses with errors below a value, a curve for each run."""
    judged = {run: run.outcome.errors[span] for run in shown if span in run.outcome.errors}
    if not judged:
        return None
    over = "per update" if span == "update" else f"over {span}"
    values = {run: 1e3 * found.se2_translation for run, found in judged.items()}
    limit = _bound(bound, span, MOTION[0])
    return figure(
        f"Share of the poses whose error {over} is below a value: further left is better"
        f"{_limit_words(limit, 'mm')}",
        _cumulative(f"error of translation {over} [mm]", values, limit),
    )


def over_runs(found: Mapping[str, Sequence[float]], shown: Sequence[Named]) -> Markup | None:
    """Shares of the runs with absolute errors [mm] below a value, a curve for each algorithm."""
    finite = {name: np.sort([e for e in own if math.isfinite(e)]) for name, own in found.items()}
    kept = [values for values in finite.values() if len(values)]
    if not kept:
        return None
    x = _log_axis("absolute error [mm]", kept, None)
    marks = []
    for curve in shown:
        values = finite[curve.name]
        if len(values):
            share = (np.arange(len(values)) + 1) / len(found[curve.name])
            at = np.log10(np.maximum(values, 10.0**x.low))
            steps = np.repeat(np.append(at, x.high), 2)[1:], np.repeat(share, 2)
            up = np.append(steps[1], share[-1])
            marks.append(line(steps[0], up, (x, SHARE), f"{curve.kind} mark", curve.name))
    return figure(
        "Share of the runs whose absolute error is below a value: further left and higher is "
        "better; a run that failed never comes.",
        plot("errors of all runs", x, SHARE, marks),
    )


def against_cost(points: Sequence[Point], kinds: Mapping[str, str]) -> Markup | None:
    """Error against CPU time on logarithmic axes; a line along those that none beats in both."""
    if not points:
        return None
    x = _point_axis("CPU per scan [ms]", [point.cpu_ms for point in points])
    y = _point_axis("mean error [mm]", [point.error_mm for point in points])
    at = {point: (math.log10(point.cpu_ms), math.log10(point.error_mm)) for point in points}
    best = np.array([at[point] for point in front(points)])
    marks = [line(best[:, 0], best[:, 1], (x, y), "front", "best")] if len(best) else []
    for point, (across_x, up) in at.items():
        words = f"{point.name}: {point.error_mm:.3g} mm, {point.cpu_ms:.3g} ms"
        shape = "cross" if point.lost else "point"
        where = f"M{across_x:.4f} {up:.4f}h0"
        kind = f"{shape} {kinds.get(point.name, '')} mark"
        marks.append(element("path", element("title", words), class_=kind, d=where))
    notes = [Note(*at[point], point.name, f"{kinds.get(point.name, '')} mark") for point in points]
    return figure(
        "Mean error against CPU time per scan, both logarithmic: lower left is better. The line "
        "joins those that no other beats in both; squares were lost.",
        plot("error against CPU per scan", x, y, marks, zoom="", notes=notes),
    )


def histograms(shown: Sequence[Run]) -> Markup | None:
    """[Kuehn] Fig. 2 and 3: shares of the updates in classes of error."""
    judged = [run for run in shown if "update" in run.outcome.errors]
    if not judged:
        return None
    drawn = (_histogram(judged, measure, k) for k, measure in enumerate(PAPER, start=2))
    return element("div", *drawn, class_="pair")


def over_time(shown: Sequence[Run], bound: dict[str, Any], span: str) -> Markup | None:
    """Errors of translation and rotation over a span, as they came."""
    judged = [run for run in shown if span in run.outcome.errors]
    if not judged:
        return None
    return together(*(_course(judged, measure, bound, span) for measure in MOTION))


def latency(shown: Sequence[Run]) -> Markup | None:
    """CPU time of each scan: how it is distributed, and as it came."""
    timed = [run for run in shown if len(run.outcome.seconds)]
    if not timed:
        return None
    limit = _period(timed[0].outcome.t)
    spent = {run: 1e3 * run.outcome.seconds for run in timed}
    start = _start(timed)
    series = {run: (run.outcome.t - start, values) for run, values in spent.items()}
    words = _limit_words(limit, "ms")
    return together(
        figure(
            f"Share of the scans that took less CPU time than a value{words}",
            _cumulative("CPU time per scan [ms]", spent, limit),
        ),
        figure(
            f"CPU time per scan as it came{words}", _bands("CPU time per scan [ms]", series, limit)
        ),
    )


def _histogram(judged: Sequence[Run], measure: Measure, number: int) -> Markup:
    values = {run: measure.values(run.outcome.errors["update"]) for run in judged}
    width = class_width(list(values.values()), measure.width)
    title = f"error of {measure.name} per update"
    return figure(
        f"Fig. {number} of the paper: {title}, share of the updates in classes of "
        f"{1e3 * width:.3g} {measure.unit} (the paper's are {1e3 * measure.width:g}).",
        _bars(f"{title} [{measure.unit}]", values, width),
    )


def _course(judged: Sequence[Run], measure: Measure, bound: dict[str, Any], span: str) -> Markup:
    start = _start(judged)
    over = "per update" if span == "update" else f"over {span}"
    series = {
        run: (errors.t - start, 1e3 * measure.values(errors))
        for run in judged
        for errors in [run.outcome.errors[span]]
    }
    limit = _bound(bound, span, measure)
    return figure(
        f"Error of {measure.name} {over}: the line is the mean of a stretch of time, the area "
        f"reaches from its least to its greatest{_limit_words(limit, measure.unit)}",
        _bands(f"error of {measure.name} {over} [{measure.unit}]", series, limit),
    )


def _bars(title: str, errors: dict[Run, Floats], width: float) -> Markup:
    edges = width * np.arange(CLASSES)
    texts = tuple((float(edge), f"{1e3 * edge:.3g}") for edge in edges)
    x = Axis(title, 0.0, width * CLASSES, marks=texts)
    thickness = 0.8 * width / len(errors)
    shares = {run: class_shares(values, width, CLASSES) for run, values in errors.items()}
    marks = []
    for k, run in enumerate(errors):
        for edge, share in zip(edges, shares[run], strict=True):
            left, words = edge + 0.1 * width + k * thickness, f"{run.name}: {100 * share:.3g} %"
            if share > 0.0:
                marks.append(bar(left, thickness, share, run.mark, words))
    y = Axis("relative frequency", 0.0, 1.05 * max(float(own.max()) for own in shares.values()))
    return plot(f"histogram: {title}", x, y, marks, zoom="")


def _cumulative(title: str, series: dict[Run, Floats], limit: Limit | None) -> Markup:
    """Which share of the values lies below each, on a logarithmic scale."""
    x = _log_axis(title, list(series.values()), limit)
    marks = []
    for run, values in series.items():
        chosen = thinned(len(values))
        ordered = np.log10(np.maximum(np.sort(values)[chosen], 10.0**x.low))
        marks.append(line(ordered, (chosen + 1) / len(values), (x, SHARE), run.mark, run.name))
    if limit:
        marks.append(across(math.log10(limit.value), SHARE, limit.name, upright=True))
    return plot(f"distribution: {title}", x, SHARE, marks)


def _bands(title: str, series: dict[Run, tuple[Floats, Floats]], limit: Limit | None) -> Markup:
    """Values over time on a logarithmic scale, thinned to stretches of time."""
    last = max(float(t.max()) for t, _ in series.values())
    x = Axis(SECONDS, 0.0, max(last, 1e-3))
    y = _log_axis(title, [values for _, values in series.values()], limit)
    areas, lines = [], []
    for run, (t, values) in series.items():
        visible = np.maximum(values, 10.0**y.low)
        at, least, _, greatest = envelope(t, visible, STRETCHES)
        areas.append(band(at, np.log10(least), np.log10(greatest), (x, y), run.mark, run.name))
        at, _, mean, _ = envelope(t, visible, MEANS)
        lines.append(line(at, np.log10(mean), (x, y), run.mark, run.name))
    if limit:
        lines.append(across(math.log10(limit.value), x, limit.name))
    return plot(f"over time: {title}", x, y, [*areas, *lines], group="time")


def _log_axis(title: str, series: Sequence[Floats], limit: Limit | None) -> Axis:
    """From where the smallest run has 5 % of its values to the greatest value of all."""
    low = min(float(np.percentile(values, 5)) for values in series)
    high = max(float(values.max()) for values in series)
    if limit:
        low, high = min(low, 0.8 * limit.value), max(high, 1.25 * limit.value)
    low, high = max(low, 1e-6 * high, LEAST), max(high, 10.0 * LEAST)
    low = min(low, 0.5 * high)
    return Axis(
        title, round(math.log10(low) - 0.05, 2), round(math.log10(high) + 0.05, 2), log=True
    )


def _point_axis(title: str, values: Sequence[float]) -> Axis:
    """A logarithmic axis around single values, with room for their names."""
    low, high = math.log10(max(min(values), LEAST)), math.log10(max(max(values), LEAST))
    margin = 0.15 + 0.08 * (high - low)
    return Axis(title, round(low - margin, 2), round(high + margin, 2), log=True)


def _start(shown: Sequence[Run]) -> float:
    return min(float(run.outcome.t.min()) for run in shown)


def _bound(bound: dict[str, Any], span: str, measure: Measure) -> Limit | None:
    value = bound.get(span, {}).get(measure.limit)
    return Limit(1e3 * value, BOUND) if value else None


def _period(t: Floats) -> Limit | None:
    """Time between scans [ms]: the median, as stamps may jump."""
    steps = np.diff(np.sort(t))
    steps = steps[steps > 0.0]
    return Limit(1e3 * float(np.median(steps)), "time between scans") if len(steps) else None


def _limit_words(limit: Limit | None, unit: str) -> str:
    return f"; the dotted line is the {limit.name}, {limit.value:.3g} {unit}." if limit else "."
