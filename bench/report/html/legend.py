"""Colors and dashes of the runs, the same in every figure, and the legend that shows and hides."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from bench.report.html.markup import Markup, element
from bench.report.palette import COLORS

# a second cue beside the color; 14 colors and 5 patterns make 70 pairs
DASHES = ("none", "9 3", "2 3", "9 3 2 3", "16 4")
PAPER, NIGHT = "#FFFFFF", "#14171C"  # the pages' backgrounds, as in report.css
INVERTED = {"#000000": "#FFFFFF"}  # on the dark page
CONTRAST = 3.0  # least contrast of a line with its background (WCAG 2.1, 1.4.11)


class Named(Protocol):
    """Something with a name and `kind`, the class run-K of its K-th color."""

    @property
    def kind(self) -> str:
        """The class."""
        ...

    @property
    def name(self) -> str:
        """What the legend says."""
        ...


def legend(shown: Sequence[Named]) -> Markup:
    """A check box per run; hiding needs no script, `rules` has it."""
    boxes = [
        element(
            "label",
            element("input", type="checkbox", checked=True, id=f"show-{run.kind}"),
            element(
                "svg",
                element("path", d="M1 5H33"),
                class_=f"swatch {run.kind}",
                viewBox="0 0 34 10",
                aria_hidden="true",
            ),
            run.name,
        )
        for run in shown
    ]
    return element("fieldset", element("legend", "show"), *boxes, class_="legend")


def rules(shown: Sequence[Named]) -> str:
    """Style rules: the color and the dashes of each run, and how its check box hides it."""
    lines = []
    for kind in (run.kind for run in shown):
        k = int(kind.removeprefix("run-"))
        color = COLORS[k % len(COLORS)]
        light, dark = legible(color, PAPER), legible(INVERTED.get(color, color), NIGHT)
        lines += [
            f".{kind}{{--light:{light};--dark:{dark};--dash:{DASHES[k % len(DASHES)]}}}",
            f".figures:has(#show-{kind}:not(:checked)) .mark.{kind}{{display:none}}",
        ]
    return "\n".join(lines)


def legible(color: str, background: str) -> str:
    """The color, mixed with black or white until it stands out from the background."""
    channels, ground = _channels(color), _luminance(_channels(background))
    pole = 0.0 if ground > 0.5 else 1.0
    share = 0.0
    while _contrast(_luminance(_mixed(channels, pole, share)), ground) < CONTRAST:
        share += 0.05
    return "#" + "".join(f"{round(255 * c):02X}" for c in _mixed(channels, pole, share))


def _mixed(channels: list[float], pole: float, share: float) -> list[float]:
    return [(1.0 - share) * c + share * pole for c in channels]


def _channels(color: str) -> list[float]:
    return [int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]


def _luminance(channels: list[float]) -> float:
    """Relative luminance of an sRGB color (WCAG 2.1)."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def _contrast(a: float, b: float) -> float:
    return (max(a, b) + 0.05) / (min(a, b) + 0.05)
