"""Typed results of the benchmark, written and read: comparisons here, sweeps in `sweep`."""

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

RESULTS_FORMAT = "results-4"
RESULTS_FILE = "results.json"


class Errors(TypedDict):
    """Errors against ground truth; `spans` has the moments over each span of time or distance."""

    dropped: int
    spans: dict[str, dict[str, Any]]
    ate_m: float
    end_m: float
    drift: float | None


class Row(TypedDict, total=False):
    """The figures of one run as in results.json; None where a figure is not meaningful.

    A failed run has only `algorithm`, `log` and the reason in `failed`. `used` are the sensors
    behind the poses, None if unknown; `posed` and `refined` are the shares of scans that were
    matched by the paper's mechanism and that were refined.
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
    """The result of one run; a failed run has only its row.

    `t` (n,) [s], `poses` (n, 3). `frame` is the first pose in the frame of `grid`, not the identity
    for maps of other programs. `common` are the poses with their ground truth.
    """

    row: Row
    t: Floats = field(default_factory=lambda: np.zeros(0))
    poses: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    grid: OccupancyGrid | None = None
    common: Common | None = None
    frame: Pose2 = IDENTITY

    @cached_property
    def errors(self) -> dict[str, SpanErrors]:
        """The errors over each span that the log has, by the span's name."""
        from bench.judge import metrics

        return {} if self.common is None else metrics.errors_over_spans(self.common)


class Reference(NamedTuple):
    """The ground truth of a log.

    `entry` is the log's part of results.json, `path` (n, 3) the true path in the frame of its first
    pose, `grid` the true map in the world frame, `start` the first true pose in the world frame.
    """

    entry: Line
    path: Floats | None = None
    grid: OccupancyGrid | None = None
    start: Pose2 | None = None


class LogResult(NamedTuple):
    """All results on one log."""

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
    """All results of a comparison.

    `facts` are command, machine and versions; `over_logs` are the tests over all its logs.
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
            "format": RESULTS_FORMAT,
            **self.facts,
            "logs": [log.entry for log in self.logs],
            "rows": self.rows,
            "over_logs": self.over_logs,
        }


def write_figures(path: Path, figures: Mapping[str, Any]) -> None:
    """Write a dict of figures as strict JSON; numbers that are not finite become null."""
    from slams.summary import as_json

    path.write_text(as_json(dict(figures)), encoding="utf-8")


def read_figures(path: str | Path, expected: str | None = None) -> Line:
    """Read a file of `write_figures` and check its format.

    Raises:
        ValueError: it is no JSON object, or has another format.
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
