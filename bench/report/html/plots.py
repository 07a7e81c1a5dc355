"""Plots that need no script: lines in a stretched SVG, ticks and names as text around it.

The view box of the SVG is the visible part in the units of the data (of a logarithmic axis: the
logarithm to base 10). So a plot fills any width with text of its full size, and report.js zooms by
changing the view box and the ticks. y points upward inside the group that holds the marks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.report.html.markup import Markup, element
from bench.report.palette import RIGHT
from slams.types import Floats

POINTS = 1500  # most of one line
STEPS = 20_000  # that coordinates resolve over the whole axis: 20-fold zoom stays smooth
TICKS = 6  # about, per axis

Tick = tuple[float, str]


class Axis(NamedTuple):
    """The visible range of one direction; `low` and `high` of a `log` axis are logarithms.

    `marks` are ticks chosen by hand; lines resolve 1 / `steps` of the range.
    """

    label: str
    low: float
    high: float
    log: bool = False
    marks: tuple[Tick, ...] = ()
    steps: int = STEPS

    @property
    def span(self) -> float:
        """Its length."""
        return self.high - self.low

    def ticks(self) -> Sequence[Tick]:
        """Places and what is written there."""
        return self.marks or ticks(self.low, self.high, self.log)


class Note(NamedTuple):
    """A word beside a point of a plot; `kind` is its class."""

    x: float
    y: float
    text: str
    kind: str = ""


def plot(
    title: str,
    x: Axis,
    y: Axis,
    marks: Sequence[Markup],
    zoom: str = "x",
    group: str = "",
    notes: Sequence[Note] = (),
) -> Markup:
    """A plot of marks; `zoom` "x", "xy" with equal axes, or "" for none.

    Plots of one `group` show the same part of their axes `zoom`; `notes` stay where they are.
    """
    equal = zoom == "xy"
    view = f"{short(x.low)} {short(-y.high)} {short(x.span)} {short(y.span)}"
    drawing = element(
        "svg",
        element("title", title),
        element("g", _grid(x, y), *marks, transform="scale(1 -1)"),
        viewBox=view,
        preserveAspectRatio="none",
        role="img",
        aria_label=title,
    )
    return element(
        "div",
        element("span", y.label, class_="y-label"),
        element("div", *_labels(y, "bottom"), class_="y-ticks", aria_hidden="true"),
        drawing,
        element("div", *(_note(note, x, y) for note in notes), class_="notes") if notes else None,
        element("div", *_labels(x, "left"), class_="x-ticks", aria_hidden="true"),
        element("span", x.label, class_="x-label"),
        class_="plot equal" if equal else "plot",
        style=f"--ratio:{x.span / y.span:.4f}" if equal else None,
        data_zoom=zoom or None,
        data_group=group or None,
        data_x="log" if x.log else None,
        data_y="log" if y.log else None,
    )


def _note(note: Note, x: Axis, y: Axis) -> Markup:
    left, bottom = ((at - axis.low) / axis.span for at, axis in ((note.x, x), (note.y, y)))
    side = "right" if left > RIGHT else "left"
    place = 100 * (1.0 - left if side == "right" else left)
    where = f"{side}:{place:.1f}%;bottom:{100 * bottom:.1f}%"
    return element("span", note.text, class_=note.kind or None, style=where)


def figure(words: str, *drawn: Markup) -> Markup:
    """What is drawn, and in words below what it shows."""
    return element("figure", *drawn, element("figcaption", words))


def ticks(low: float, high: float, log: bool = False) -> list[Tick]:
    """Round numbers within a range; report.js has the same for a range zoomed into."""
    if log:
        steps: tuple[int, ...] = (1,) if high - low > 2.5 else (1, 2, 5)
        decades = range(math.floor(low), math.ceil(high) + 1)
        values = [step * 10.0**k for k in decades for step in steps]
        found = [(math.log10(value), short(value)) for value in values]
        inside = [tick for tick in found if low <= tick[0] <= high]
        if len(inside) > 1:
            return inside
        return [(math.log10(v), text) for v, text in ticks(10.0**low, 10.0**high) if v > 0.0]
    step = _round_step((high - low) / TICKS)
    count = range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)
    return [(k * step, short(round(k * step, 12))) for k in count]


def line(
    x: Floats, y: Floats, axes: tuple[Axis, Axis], kind: str, title: str, **attributes: object
) -> Markup:
    """A line through points; `kind` is its class, `title` appears under the pointer."""
    where = path(x, y, axes)
    return element("path", element("title", title), class_=f"line {kind}", d=where, **attributes)


def band(
    x: Floats, low: Floats, high: Floats, axes: tuple[Axis, Axis], kind: str, title: str
) -> Markup:
    """The area between two lines."""
    around = path(np.concatenate([x, x[::-1]]), np.concatenate([high, low[::-1]]), axes)
    return element("path", element("title", title), class_=f"band {kind}", d=f"{around}Z")


def bar(left: float, width: float, height: float, kind: str, title: str) -> Markup:
    """An upright bar on the x axis."""
    where = f"M{short(left)} 0V{short(height)}h{short(width)}V0Z"
    return element("path", element("title", title), class_=f"bar {kind}", d=where)


def path(x: Floats, y: Floats, axes: tuple[Axis, Axis]) -> str:
    """Points as the data of an SVG path, no finer than a zoomed plot can show."""
    columns = [_rounded(values, axis) for values, axis in zip((x, y), axes, strict=True)]
    return "M" + " ".join(f"{a},{b}" for a, b in zip(*columns, strict=True))


def thinned(n: int, most: int = POINTS) -> NDArray[np.int64]:
    """Indices of at most `most` of n points, evenly, with the first and the last."""
    chosen: NDArray[np.int64] = np.unique(np.linspace(0, n - 1, min(n, most)).astype(np.int64))
    return chosen


def means(t: Floats, values: Floats, most: int) -> tuple[Floats, Floats]:
    """Mean time and value of at most `most` equal stretches of time."""
    order = np.argsort(t, kind="stable")
    t, values = t[order], values[order]
    width = max(float(t[-1] - t[0]), 1e-9) / most
    stretch = np.minimum(((t - t[0]) / width).astype(np.int64), most - 1)
    starts = np.flatnonzero(np.diff(stretch, prepend=-1))
    counts = np.diff(starts, append=len(t))
    return np.add.reduceat(t, starts) / counts, np.add.reduceat(values, starts) / counts


def _grid(x: Axis, y: Axis) -> Markup:
    upright = [f"M{short(at)} {short(y.low)}V{short(y.high)}" for at, _ in x.ticks()]
    level = [f"M{short(x.low)} {short(at)}H{short(x.high)}" for at, _ in y.ticks()]
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
    digits = max(0, math.ceil(-math.log10(axis.span / axis.steps)))
    reach = 1e3 * axis.span  # what is further outside is not seen anyway
    kept = np.clip(values, axis.low - reach, axis.high + reach)
    return [
        f"{value:.{digits}f}".rstrip("0").rstrip(".") if digits else f"{value:.0f}"
        for value in kept
    ]


def short(value: float) -> str:
    """A number with six digits at most."""
    return f"{value:.6g}"
