"""What the figures show, its colors and dashes, and the legend that shows and hides it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bench.report.html.markup import Markup, element
from bench.report.lines import label, value
from bench.report.palette import COLORS

if TYPE_CHECKING:
    from bench.results import LogResult, Outcome

# where a line of that color would not stand out from the page: contrast below 3 (WCAG 2.1, 1.4.11)
ON_LIGHT = {"#E69F00": "#C38700", "#00C000": "#00AD00", "#A0C040": "#809A33", "#56B4E9": "#4999C6"}
ON_DARK = {"#000000": "#FFFFFF"}
# a second cue beside the color; 14 colors and 5 patterns make 70 pairs
DASHES = ("none", "9 3", "2 3", "9 3 2 3", "16 4")


@dataclass(frozen=True, eq=False)
class Curve:
    """What a figure shows: the class of its color and dashes, run-K of the K-th, and its name."""

    kind: str
    name: str


@dataclass(frozen=True, eq=False)
class Run(Curve):
    """A run on one log."""

    outcome: Outcome

    @property
    def lost(self) -> bool:
        """Whether it lost its way."""
        return bool(value(self.outcome.row, "loss/lost"))


def runs(done: LogResult) -> list[Run]:
    """Those that did not fail."""
    return [
        Run(f"run-{k}", label(outcome.row), outcome)
        for k, outcome in enumerate(done.outcomes)
        if not outcome.row["failed"]
    ]


def legend(shown: Sequence[Curve]) -> Markup:
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


def rules(shown: Sequence[Curve]) -> str:
    """Style rules: the color and the dashes of each run, and how its check box hides it."""
    lines = []
    for kind in (run.kind for run in shown):
        k = int(kind.removeprefix("run-"))
        color = COLORS[k % len(COLORS)]
        light, dark = ON_LIGHT.get(color, color), ON_DARK.get(color, color)
        lines += [
            f".{kind}{{--light:{light};--dark:{dark};--dash:{DASHES[k % len(DASHES)]}}}",
            f".figures:has(#show-{kind}:not(:checked)) .mark.{kind}{{display:none}}",
        ]
    return "\n".join(lines)
