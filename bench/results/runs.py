"""Typed values of one run and of one log: what every table, figure and page is drawn from."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

import numpy as np

from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2

if TYPE_CHECKING:
    from bench.judge.metrics import Common, SpanErrors


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

    `t` (n,) [s], `poses` (n, 3) and `seconds` (n,) CPU of each update (empty where nobody measured
    it); `grid` lies in the frame of the first pose, or, where another program drew it, in one in
    which the first pose is `frame`; `common` are the poses that have a truth, beside it.
    """

    row: Row
    t: Floats = field(default_factory=lambda: np.zeros(0))
    poses: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    seconds: Floats = field(default_factory=lambda: np.zeros(0))
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
