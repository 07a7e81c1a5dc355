"""Figures of matplotlib inside a page, in the page's own colors."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from bench.report.html.markup import Markup, element
from bench.report.palette import Look

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# colors that only stand for the page's, which are others on a dark one
RUN, TEXT, FAINT = "#010203", "#020304", "#030405"
VARIABLES = {
    RUN: "var(--color)",
    TEXT: "var(--text)",
    FAINT: "var(--faint)",
    "#000000": "var(--text)",
    "#b2b2b2": "var(--unknown)",  # ground of a map, `palette.UNKNOWN`
}
WIDE, MAP = (4.4, 3.2), (3.0, 3.0)  # inches; with 10 pt text readable on a screen of 390 px
IMAGE_DPI = 200  # of the maps
STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "font.size": 10,
    "text.color": TEXT,
    "axes.labelcolor": TEXT,
    "axes.edgecolor": FAINT,
    "axes.facecolor": "none",
    "figure.facecolor": "none",
    "grid.color": FAINT,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
}


def look(kind: str) -> Look:
    """The look of a run by the class that `legend.rules` colors."""
    return Look(RUN, "-", kind)


def drawing(label: str, draw: Callable[[Axes], None], size: tuple[float, float] = WIDE) -> Markup:
    """What `draw` puts on axes, as an svg with a label; same input, same bytes."""
    text = io.StringIO()
    with mpl.rc_context({**STYLE, "svg.hashsalt": label}):
        figure = Figure(figsize=size, dpi=IMAGE_DPI, layout="constrained")
        draw(figure.subplots())
        FigureCanvasSVG(figure).print_svg(text, metadata={"Date": None})  # type: ignore[no-untyped-call]
    found = re.search(r'<svg [^>]*viewBox="([^"]+)"[^>]*>(.*)</svg>', text.getvalue(), re.DOTALL)
    assert found is not None
    inner = re.sub(r"<(metadata|style).*?</\1>", "", found[2], flags=re.DOTALL)
    inner = re.sub(r'<g id="([\w.-]+)"', _group, inner)
    for color, variable in VARIABLES.items():
        inner = inner.replace(color, variable)
    return element(
        "svg",
        element("title", label),
        Markup(inner),
        class_="drawn",
        viewBox=found[1],
        role="img",
        aria_label=label,
    )


def figure(words: str, *drawn: Markup | None) -> Markup:
    """What is drawn, and in words below what it shows."""
    return element("figure", *drawn, element("figcaption", words))


def _group(match: re.Match[str]) -> str:
    """The group of a run with its classes; other ids, the same in every svg, go."""
    name = match[1]
    if name.startswith("run-"):
        return f'<g class="{name} mark"'
    return f'<g class="{name}"' if name in ("truth", "scale") else "<g"
