"""Results as typed values, written and read: of a comparison here, of a sweep in `sweep`.

Everything the benchmark shows is drawn from these.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

import numpy as np

from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2

if TYPE_CHECKING:
    from bench.judge.metrics import Common, SpanErrors

FORMAT = "results-4"
FIGURES = "results.json"


class Errors(TypedDict):
    """Against the truth: `spans` have the moments of the errors over each span of time or way."""

    dropped: int
    spans: dict[str, dict[str, Any]]
    ate_m: float
    end_m: float
    drift: float | None


class Row(TypedDict, total=False):
    """Every figure of one run, as it stands in results.json; None where it has no meaning.

    A run that failed has `algorithm`, `log` and the reason in `failed`, and nothing else. `used`
    are the sensors the poses come from, None where nobody knows; `posed` and `refined` the shares
    of the scans that the paper's own mechanism and the step behind it took part in.
    """

    algorithm: str
    log: str
    failed: str | None
    used: list[str] | None
    posed: float | None
    refined: float | None
    scans: int
    duration_s: float
    cpu_ms_per_scan: float
    real_time_factor: float
    cost: dict[str, Any] | None
    errors: Errors | None
    relations: dict[str, Any] | None
    starts: dict[str, Any] | None
    loss: dict[str, Any]
    map: dict[str, float | None] | None
    consistency: dict[str, Any]
    disagreement_m: float | None
    conflict: float | None
    report: dict[str, Any]
    seed: int
    parameters: dict[str, Any]
    meta: dict[str, Any]


Rows = list[Row]
Line = dict[str, Any]


@dataclass(frozen=True)
class Outcome:
    """What came of one run; a failed one has only its row.

    `t` (n,) [s], `poses` (n, 3); `grid` lies in the frame of the first pose, or, where another
    program drew it, in one in which the first pose is `frame`; `common` are the poses that have a
    truth, beside it.
    """

    row: Row
    t: Floats = field(default_factory=lambda: np.zeros(0))
    poses: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    grid: OccupancyGrid | None = None
    common: Common | None = None
    frame: Pose2 = IDENTITY

    @cached_property
    def errors(self) -> dict[str, SpanErrors]:
        """The errors over every span that the log has, by the span's name."""
        from bench.judge import metrics

        return {} if self.common is None else metrics.errors_over_spans(self.common)


class Reference(NamedTuple):
    """What is known of a log besides its scans.

    `entry` is the log's in results.json; `path` (n, 3) the truth seen from its first pose, `grid`
    the true map in the frame of the world, `start` the first true pose in it.
    """

    entry: Line
    path: Floats | None = None
    grid: OccupancyGrid | None = None
    start: Pose2 | None = None


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
