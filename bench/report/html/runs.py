"""The runs a report shows, and how each is recognized in every figure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bench.report.lines import label, value

if TYPE_CHECKING:
    from bench.results import LogResult, Outcome


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
