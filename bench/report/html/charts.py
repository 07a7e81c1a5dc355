"""Errors and cost: shares below a value, error against CPU, [Kuehn] Fig. 2 and 3, over time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from bench.judge.metrics import ORIENTATION_CLASS, TRANSLATION_CLASS, SpanErrors, class_shares
from bench.report.figures import CLASSES, SHOWN_FROM, class_width
from bench.report.html.legend import Named
from bench.report.html.markup import Markup, element, together
from bench.report.html.plots import Axis, Note, bar, figure, line, means, plot, thinned
from bench.report.html.runs import Run
from bench.report.pareto import Point, front, spread
from slams.types import Floats

STRETCHES = 300  # of time that a line is made of
LEAST = 1e-4  # ms, mm or mrad; less is drawn as this
SHARE = Axis("share below", 0.0, 1.0)


class Measure(NamedTuple):
    """A series of errors in units of thousandths; `width` is that of the paper's classes."""

    name: str
    values: Callable[[SpanErrors], Floats]
    width: float
    unit: str


# the histograms are the paper's, of its errors; over time it is the motion by itself that counts
PAPER = (
    Measure("translation", lambda errors: errors.translation, TRANSLATION_CLASS, "mm"),
    Measure("orientation", lambda errors: errors.orientation, ORIENTATION_CLASS, "mrad"),
)
MOTION = (PAPER[0]._replace(values=lambda e: e.se2_translation), PAPER[1]._replace(name="rotation"))


def errors(shown: Sequence[Run], span: str) -> Markup | None:
    """Shares of the poses with errors below a value, a curve for each run."""
    judged = [run for run in shown if span in run.outcome.errors]
    values = {run.name: 1e3 * np.sort(run.outcome.errors[span].se2_translation) for run in judged}
    counts = {name: len(found) for name, found in values.items()}
    return _shares(
        f"error of translation {_over(span)} [mm]",
        f"Share of the poses whose error {_over(span)} is below a value: further left is better.",
        (values, counts),
        judged,
    )


def over_runs(found: Mapping[str, Sequence[float]], shown: Sequence[Named]) -> Markup | None:
    """Shares of the runs with absolute errors [mm] below a value, a curve for each algorithm."""
    values = {name: np.sort([e for e in own if math.isfinite(e)]) for name, own in found.items()}
    counts = {name: len(own) for name, own in found.items()}
    return _shares(
        "absolute error [mm]",
        "Share of the runs whose absolute error is below a value: further left and higher is "
        "better; a run that failed never comes.",
        (values, counts),
        [curve for curve in shown if len(values[curve.name])],
    )


def against_cost(points: Sequence[Point], kinds: Mapping[str, str]) -> Markup | None:
    """Error against CPU time on logarithmic axes; a line along those that none beats in both."""
    if not points:
        return None
    x = _log_axis("CPU per scan [ms]", np.array([point.cpu_ms for point in points]), 0.2)
    y = _log_axis("mean error [mm]", np.array([point.error_mm for point in points]), 0.2)
    at = {point: (_log(point.cpu_ms), _log(point.error_mm)) for point in points}
    best = np.array([at[point] for point in front(points)])
    marks = [line(best[:, 0], best[:, 1], (x, y), "front", "best")] if len(best) else []
    for point, (right, up) in at.items():
        words = f"{point.name}: {point.error_mm:.3g} mm, {point.cpu_ms:.3g} ms"
        shape = "cross" if point.lost else "point"
        kind = f"{shape} {kinds.get(point.name, '')} mark"
        where = f"M{right:.4f} {up:.4f}h0"
        marks.append(element("path", element("title", words), class_=kind, d=where))
    return figure(
        "Mean error against CPU time per scan, both logarithmic: lower left is better. The line "
        "joins those that no other beats in both; squares were lost.",
        plot("error against CPU per scan", x, y, marks, zoom="", notes=_names(at, (x, y), kinds)),
    )


def histograms(shown: Sequence[Run]) -> Markup | None:
    """[Kuehn] Fig. 2 and 3: shares of the updates in classes of error."""
    judged = [run for run in shown if "update" in run.outcome.errors]
    if not judged:
        return None
    drawn = (_histogram(judged, measure, k) for k, measure in enumerate(PAPER, start=2))
    return element("div", *drawn, class_="pair")


def over_time(shown: Sequence[Run], span: str) -> Markup | None:
    """Errors of translation and rotation over a span, as they came."""
    judged = [run for run in shown if span in run.outcome.errors]
    return together(*(_course(judged, measure, span) for measure in MOTION)) if judged else None


def _names(
    at: Mapping[Point, tuple[float, float]], axes: tuple[Axis, Axis], kinds: Mapping[str, str]
) -> list[Note]:
    """The names of the points, none over another."""
    x, y = axes
    heights = spread([((a - x.low) / x.span, (b - y.low) / y.span) for a, b in at.values()])
    return [
        Note(right, y.low + height * y.span, point.name, f"{kinds.get(point.name, '')} mark")
        for (point, (right, _)), height in zip(at.items(), heights, strict=True)
    ]


def _histogram(judged: Sequence[Run], measure: Measure, number: int) -> Markup:
    values = {run: measure.values(run.outcome.errors["update"]) for run in judged}
    width = class_width(list(values.values()), measure.width)
    title = f"error of {measure.name} per update"
    return figure(
        f"Fig. {number} of the paper: {title}, share of the updates in classes of "
        f"{1e3 * width:.3g} {measure.unit} (the paper's are {1e3 * measure.width:g}).",
        _bars(f"{title} [{measure.unit}]", values, width),
    )


def _bars(title: str, values: dict[Run, Floats], width: float) -> Markup:
    edges = width * np.arange(CLASSES)
    signs = [*[""] * (CLASSES - 1), "≥ "]
    texts = tuple(
        (float(edge), f"{sign}{1e3 * edge:.3g}") for edge, sign in zip(edges, signs, strict=True)
    )
    x = Axis(title, 0.0, width * CLASSES, marks=texts)
    thickness = 0.8 * width / len(values)
    shares = {run: class_shares(found, width, CLASSES) for run, found in values.items()}
    marks = []
    for k, run in enumerate(values):
        for edge, share in zip(edges, shares[run], strict=True):
            left, words = edge + 0.1 * width + k * thickness, f"{run.name}: {100 * share:.3g} %"
            if share > 0.0:
                marks.append(bar(left, thickness, share, run.mark, words))
    y = Axis("relative frequency", 0.0, 1.05 * max(float(own.max()) for own in shares.values()))
    return plot(f"histogram: {title}", x, y, marks, zoom="")


def _course(judged: Sequence[Run], measure: Measure, span: str) -> Markup:
    """Means of stretches of time, on a logarithmic scale."""
    start = min(float(run.outcome.t.min()) for run in judged)
    found = {run: run.outcome.errors[span] for run in judged}
    series = {
        run: means(own.t - start, 1e3 * measure.values(own), STRETCHES)
        for run, own in found.items()
    }
    title = f"error of {measure.name} {_over(span)} [{measure.unit}]"
    last = max(float(t.max()) for t, _ in series.values())
    x = Axis("time since the first scan [s]", 0.0, max(last, 1e-3))
    y = _log_axis(title, np.concatenate([values for _, values in series.values()]))
    lines = [
        line(t, _logs(values, y), (x, y), run.mark, run.name) for run, (t, values) in series.items()
    ]
    return figure(
        f"Error of {measure.name} {_over(span)}: means of stretches of time.",
        plot(f"over time: {title}", x, y, lines, group="time"),
    )


def _shares(
    title: str,
    words: str,
    series: tuple[Mapping[str, Floats], Mapping[str, int]],
    shown: Sequence[Named],
) -> Markup | None:
    """Which share of so many lies below each of the values, which stand in order."""
    if not shown:
        return None
    values, counts = series
    found = [values[curve.name] for curve in shown]
    inside = [own[own >= np.quantile(own, SHOWN_FROM)] for own in found]
    x = _log_axis(title, np.concatenate(inside))
    marks = []
    for curve in shown:
        chosen = thinned(len(values[curve.name]))
        at = np.append(_logs(values[curve.name][chosen], x), x.high)
        share = (chosen + 1) / counts[curve.name]
        steps = np.repeat(at, 2)[:-1], np.concatenate([[0.0], np.repeat(share, 2)])
        marks.append(line(*steps, (x, SHARE), f"{curve.kind} mark", curve.name))
    return figure(words, plot(f"distribution: {title}", x, SHARE, marks))


def _over(span: str) -> str:
    return "per update" if span == "update" else f"over {span}"


def _log(value: float) -> float:
    return math.log10(max(value, LEAST))


def _logs(values: Floats, axis: Axis) -> Floats:
    logarithms: Floats = np.log10(np.maximum(values, 10.0**axis.low))
    return logarithms


def _log_axis(title: str, values: Floats, margin: float = 0.05) -> Axis:
    """A logarithmic axis around the values, at most six decades of it."""
    high = _log(float(values.max()))
    low = max(_log(float(values.min())), high - 6.0)
    return Axis(title, round(low - margin, 2), round(max(high, low + 0.3) + margin, 2), log=True)
