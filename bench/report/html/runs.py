"""The runs a report shows, and how each is recognized in every figure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from bench.report.lines import label

if TYPE_CHECKING:
    from bench.results import LogResult, Outcome


@dataclass(frozen=True, eq=False)
class Run:
    """An outcome with its name and the class of its color and dashes (bench/html/legend.py)."""

    outcome: Outcome
    kind: str
    name: str

    @property
    def mark(self) -> str:
        """The class of what the legend hides."""
        return f"{self.kind} mark"

    @property
    def lost(self) -> bool:
        """Whether it lost its way."""
        return bool((self.outcome.row.get("loss") or {}).get("lost"))


class Curve(NamedTuple):
    """An algorithm over several runs in a figure: the class of its color, and its name."""

    kind: str
    name: str


def runs(done: LogResult) -> list[Run]:
    """Those that did not fail."""
    return [
        Run(outcome, f"run-{k}", label(outcome.row))
        for k, outcome in enumerate(done.outcomes)
        if not outcome.row["failed"]
    ]
