"""Plots of a sweep's page: lines and bands in a stretched SVG, ticks as text around it.

The view box of the SVG is the visible part in the units of the data, so a plot fills any width with
text of its full size. y points upward inside the group that holds the marks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bench.report.html.markup import Markup, element
from bench.report.html.svg import figure as figure
from slams.types import Floats

STEPS = 20_000  # that coordinates resolve over the whole axis
TICKS = 6  # about, per axis

Tick = tuple[float, str]


class Axis(NamedTuple):
    """The visible range of one direction; `marks` are ticks chosen by hand."""

    label: str
    low: float
    high: float
    marks: tuple[Tick, ...] = ()

    @property
    def span(self) -> float:
        """Its length."""
        return self.high - self.low

    def ticks(self) -> Sequence[Tick]:
        """Places and what is written there."""
        return self.marks or ticks(self.low, self.high)


def plot(title: str, x: Axis, y: Axis, marks: Sequence[Markup]) -> Markup:
    """A plot of marks."""
    drawing = element(
        "svg",
        element("title", title),
        element("g", _grid(x, y), *marks, transform="scale(1 -1)"),
        viewBox=f"{_short(x.low)} {_short(-y.high)} {_short(x.span)} {_short(y.span)}",
        preserveAspectRatio="none",
        role="img",
        aria_label=title,
    )
    return element(
        "div",
        element("span", y.label, class_="y-label"),
        element("div", *_labels(y, "bottom"), class_="y-ticks", aria_hidden="true"),
        drawing,
        element("div", *_labels(x, "left"), class_="x-ticks", aria_hidden="true"),
        element("span", x.label, class_="x-label"),
        class_="plot",
    )


def ticks(low: float, high: float) -> list[Tick]:
    """Round numbers within a range."""
    step = _round_step((high - low) / TICKS)
    count = range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)
    return [(k * step, _short(round(k * step, 12))) for k in count]


def line(x: Floats, y: Floats, axes: tuple[Axis, Axis], kind: str, title: str) -> Markup:
    """A line through points; `kind` is its class, `title` appears under the pointer."""
    return element("path", element("title", title), class_=f"line {kind}", d=path(x, y, axes))


def band(
    x: Floats, low: Floats, high: Floats, axes: tuple[Axis, Axis], kind: str, title: str
) -> Markup:
    """The area between two lines."""
    around = path(np.concatenate([x, x[::-1]]), np.concatenate([high, low[::-1]]), axes)
    return element("path", element("title", title), class_=f"band {kind}", d=f"{around}Z")


def path(x: Floats, y: Floats, axes: tuple[Axis, Axis]) -> str:
    """Points as the data of an SVG path."""
    columns = [_rounded(values, axis) for values, axis in zip((x, y), axes, strict=True)]
    return "M" + " ".join(f"{a},{b}" for a, b in zip(*columns, strict=True))


def _grid(x: Axis, y: Axis) -> Markup:
    upright = [f"M{_short(at)} {_short(y.low)}V{_short(y.high)}" for at, _ in x.ticks()]
    level = [f"M{_short(x.low)} {_short(at)}H{_short(x.high)}" for at, _ in y.ticks()]
    return element("path", class_="grid", d="".join(upright + level))


def _labels(axis: Axis, side: str) -> list[Markup]:
    return [
        element("span", text, style=f"{side}:{100 * (at - axis.low) / axis.span:.2f}%")
        for at, text in axis.ticks()
    ]


def _round_step(rough: float) -> float:
    """The least 1, 2 or 5 times a power of ten that is not below `rough`."""
    power: float = 10.0 ** math.floor(math.log10(rough))
    return next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= rough * (1.0 - 1e-9))


def _rounded(values: Floats, axis: Axis) -> list[str]:
    digits = max(0, math.ceil(-math.log10(axis.span / STEPS)))
    return [f"{value:.{digits}f}".rstrip("0").rstrip(".") for value in values]


def _short(value: float) -> str:
    return f"{value:.6g}"
