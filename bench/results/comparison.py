"""Results: what came of a log and of a comparison, as typed values; every figure as JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from bench.results.runs import Line, Outcome, Reference, Rows

if TYPE_CHECKING:
    from collections.abc import Mapping

FORMAT = "results-4"
FIGURES = "results.json"


class LogResult(NamedTuple):
    """Everything that came of one log."""

    reference: Reference
    outcomes: list[Outcome]

    @property
    def entry(self) -> Line:
        """The log's own figures."""
        return self.reference.entry

    @property
    def rows(self) -> Rows:
        """The figures of every run."""
        return [outcome.row for outcome in self.outcomes]


class Comparison(NamedTuple):
    """Everything that came of a comparison.

    `facts` tell how it was made (command, machine, versions), `over_logs` are the verdicts over all
    its logs.
    """

    facts: Line
    logs: list[LogResult]
    over_logs: list[Line]

    @property
    def rows(self) -> Rows:
        """The figures of every run on every log."""
        return [row for log in self.logs for row in log.rows]

    def by_algorithm(self) -> dict[str, Rows]:
        """The rows of each algorithm, a row for each log."""
        found: dict[str, Rows] = {}
        for row in self.rows:
            found.setdefault(row["algorithm"], []).append(row)
        return found

    def as_dict(self) -> Line:
        """The content of results.json."""
        return {
            "format": FORMAT,
            **self.facts,
            "logs": [log.entry for log in self.logs],
            "rows": self.rows,
            "over_logs": self.over_logs,
        }


def write_figures(path: Path, figures: Mapping[str, Any]) -> None:
    """Write a dict of figures as strict JSON: what is not finite becomes null."""
    from slams.summary import as_json

    path.write_text(as_json(dict(figures)), encoding="utf-8")


def read_figures(path: str | Path, expected: str | None = None) -> Line:
    """Read what `write_figures` wrote, of the format that is expected.

    Raises:
        ValueError: it is no JSON object, or of another format.
    """
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ValueError(f"{path}: damaged ({error}); run it again") from error
    if not isinstance(found, dict):
        raise ValueError(f"{path}: got {type(found).__name__}, expected an object of results")
    if expected is not None and found.get("format") != expected:
        raise ValueError(
            f"{path}: got format {found.get('format')!r}, expected {expected!r}: written by "
            "another version; run it again"
        )
    return found
