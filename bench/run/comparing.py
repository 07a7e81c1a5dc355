"""All runs of a comparison: every algorithm on every log, each in its own process."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bench.results import LogResult, Outcome
from bench.run import pool
from bench.run.cases import failed, reference, relation_error, replayed
from bench.run.pool import Ended
from slams import cli
from slams.types import Floats

if TYPE_CHECKING:
    from bench.run.cases import Choice
    from slams.scanlog import ScanLog

MAX_RELATION_ERROR = 0.03  # m, mean of the relations; starts above it are counted
MAX_START_SHARE = 0.1  # of a log, skipped by the last start
MAX_START_SCANS = 500  # skipped by the last start of a long log


class Job(NamedTuple):
    """One algorithm on the k-th log; without a label, the log's ground truth.

    `first` is the first scan of a run with another start.
    """

    label: str | None
    k: int
    first: int | None = None


def compared(
    labels: list[str], logs: list[ScanLog], choice: Choice, jobs: int, quiet: bool
) -> list[LogResult]:
    """Run every algorithm on every log; a failed run does not affect the others.

    Raises:
        RuntimeError: the ground truth of a log cannot be prepared.
    """
    calls: dict[Job, tuple[Any, tuple[Any, ...]]] = {}
    # in reverse order: the baselines are slow, and a long case must not begin last
    for k, log in reversed(list(enumerate(logs))):
        calls[Job(None, k)] = (reference, (log,))
        later = [] if choice.relations is None else start_scans(len(log), choice.starts)[1:]
        for label in reversed(labels):
            for first in (None, *later):
                calls[Job(label, k, first)] = (run, (label, log, choice, first))
    ended = pool.finished(calls, jobs)
    shown = cli.progress(ended, len(calls), "comparing", quiet, unit="run")
    found = {job: _result(job, logs[job.k], one) for job, one in shown}
    return [
        LogResult(found[Job(None, k)], [_outcome(found, Job(label, k)) for label in labels])
        for k in range(len(logs))
    ]


def run(label: str, log: ScanLog, choice: Choice, first: int | None) -> Outcome | float | None:
    """One run in this process; with `first`, only its relation error from this scan on."""
    if first is not None:
        return relation_error(replayed(label, log.rows(slice(first, None)), choice))
    outcome = replayed(label, log, choice)
    return with_consistency(outcome, log, outcome.poses)


def with_consistency(outcome: Outcome, log: ScanLog, poses: Floats) -> Outcome:
    """The run with its consistency; poses (n, 3) at the log's scans, nan for missing ones."""
    from bench.judge.consistency import consistency

    found = consistency(log, poses)._asdict()
    return replace(outcome, row=outcome.row | {"consistency": found})


def start_scans(scans: int, n: int) -> list[int]:
    """`n` first scans, evenly from 0 to a tenth of the log's `scans` (at most `MAX_START_SCANS`).

    Several starts separate a good algorithm from a lucky first map. A short log has fewer starts.
    """
    latest = min(MAX_START_SCANS, int(MAX_START_SHARE * scans))
    return [int(first) for first in np.unique(np.round(np.linspace(0, latest, n)))]


def spread_over_starts(errors: Sequence[float | None], limit: float) -> dict[str, Any]:
    """Statistics of an error over several starts; None is a lost run.

    `mean` is over the runs that were not lost. In `median` and `worst` a lost run has an infinite
    error. `above` is the number of runs above the limit, with lost ones.
    """
    values = np.array([math.inf if error is None else error for error in errors])
    found = values[np.isfinite(values)]
    return {
        "n": len(values),
        "mean": float(found.mean()) if len(found) else math.nan,
        "median": float(np.median(values)),
        "worst": float(values.max()),
        "above": int((values > limit).sum()),
        "limit_m": limit,
    }


def _outcome(found: dict[Job, Any], job: Job) -> Outcome:
    """The run from the first scan, with the statistics over several starts."""
    outcome: Outcome = found[job]
    later = [found[other] for other in found if other[:2] == job[:2] and other.first]
    if not later or outcome.row["failed"]:
        return outcome
    errors = [relation_error(outcome), *later]
    starts = spread_over_starts(errors, MAX_RELATION_ERROR)
    return replace(outcome, row=outcome.row | {"starts": starts})


def _result(job: Job, log: ScanLog, ended: Ended) -> Any:
    """The result of a job; a run that raised or whose process died has failed."""
    if ended.failure is None:
        return ended.value
    if job.label is None:
        raise RuntimeError(f"{log.name}: its ground truth cannot be prepared: {ended.failure}")
    return None if job.first is not None else failed(job.label, log, ended.failure)
