"""Errors and cost: [Kuehn] Fig. 2 and 3, and what they lack: small errors, time, the bound."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from bench.judge.metrics import ORIENTATION_CLASS, TRANSLATION_CLASS, SpanErrors, class_shares
from bench.report.figures import CLASSES
from bench.report.html.markup import Markup, element, together
from bench.report.html.plots import Axis, across, band, bar, envelope, figure, line, plot, thinned
from bench.report.html.runs import Run
from bench.report.lines import BOUND
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


def histograms(shown: Sequence[Run], bound: dict[str, Any]) -> Markup | None:
    """[Kuehn] Fig. 2 and 3, each with the same errors as cumulative shares beside."""
    judged = [run for run in shown if "update" in run.outcome.errors]
    if not judged:
        return None
    return together(
        *(_histogram(judged, measure, bound, k) for k, measure in enumerate(PAPER, start=2))
    )


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


def _histogram(
    judged: Sequence[Run], measure: Measure, bound: dict[str, Any], number: int
) -> Markup:
    errors = {run: measure.values(run.outcome.errors["update"]) for run in judged}
    small = {run: 1e3 * values for run, values in errors.items()}
    limit = _bound(bound, "update", measure)
    title = f"error of {measure.name} per update"
    return figure(
        f"Fig. {number} of the paper: {title}. Left: share of the updates in classes of "
        f"{measure.width:g} {measure.base}, the bars of a class in the order of the legend. "
        f"Right: share of the updates below a value{_limit_words(limit, measure.unit)}",
        element(
            "div",
            _bars(f"{title} [{measure.base}]", errors, measure.width),
            _cumulative(f"{title} [{measure.unit}]", small, limit),
            class_="pair",
        ),
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
    x = Axis(title, 0.0, width * CLASSES, marks=tuple((float(e), f"{e:.3g}") for e in edges))
    thickness = 0.8 * width / len(errors)
    marks = []
    for k, (run, values) in enumerate(errors.items()):
        for edge, share in zip(edges, class_shares(values, width, CLASSES), strict=True):
            left, words = edge + 0.1 * width + k * thickness, f"{run.name}: {100 * share:.3g} %"
            if share > 0.0:
                marks.append(bar(left, thickness, share, run.mark, words))
    y = Axis("relative frequency", 0.0, 1.0)
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
