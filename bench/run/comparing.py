"""All runs of a comparison: every algorithm on every log, each in a process of its own."""

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


LIMIT_M = 0.03  # of the relations' mean error: starts above it are counted
LATEST_SHARE = 0.1  # of a log that may be left out at its start
LATEST = 500  # scans that may, as so many have been left out of Intel in the measurements


class Job(NamedTuple):
    """One algorithm on the k-th log; no algorithm: what else is known of the log.

    `first` is the scan it begins at, where it is run from several.
    """

    label: str | None
    k: int
    first: int | None = None


def compared(
    labels: list[str], logs: list[ScanLog], choice: Choice, jobs: int, quiet: bool
) -> list[LogResult]:
    """Every algorithm on every log; a run that fails leaves the others as they are.

    Raises:
        RuntimeError: the truth of a log cannot be prepared.
    """
    calls: dict[Job, tuple[Any, tuple[Any, ...]]] = {}
    # the last first: the baselines are slow, and a long case must not begin at the end
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
    """One run in this process; with `first`, only its error of the relations from that scan on."""
    if first is not None:
        return relation_error(replayed(label, log.rows(slice(first, None)), choice))
    outcome = replayed(label, log, choice)
    return with_consistency(outcome, log, outcome.poses)


def with_consistency(outcome: Outcome, log: ScanLog, poses: Floats) -> Outcome:
    """The run with what its scans tell of it; poses (n, 3) at those of the log, nan for none."""
    from bench.judge.consistency import consistency

    found = consistency(log, poses)._asdict()
    return replace(outcome, row=outcome.row | {"consistency": found})


def start_scans(scans: int, n: int) -> list[int]:
    """Scans to begin at, evenly from 0 to a tenth of the log's `scans` (`LATEST` at most).

    The same log begun at several tells a good algorithm from a lucky first map. As many as `n`,
    both 1 or more, or fewer in a log too short for so many different ones.
    """
    latest = min(LATEST, int(LATEST_SHARE * scans))
    return [int(first) for first in np.unique(np.round(np.linspace(0, latest, n)))]


def spread_over_starts(errors: Sequence[float | None], limit: float) -> dict[str, Any]:
    """The spread of one error over the starts, 1 or more; None is a lost run.

    `mean` is that of the runs that were not lost. In `median` and `worst` a lost run is as bad as
    can be. `above` of the runs were above the limit, lost ones included.
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
    """The run from the first scan, with the spread over all starts where there are several."""
    outcome: Outcome = found[job]
    later = [found[other] for other in found if other[:2] == job[:2] and other.first]
    if not later or outcome.row["failed"]:
        return outcome
    errors = [relation_error(outcome), *later]
    starts = spread_over_starts(errors, LIMIT_M)
    return replace(outcome, row=outcome.row | {"starts": starts})


def _result(job: Job, log: ScanLog, ended: Ended) -> Any:
    """What came of a job: a run that raised, or whose process died, has failed."""
    if ended.failure is None:
        return ended.value
    if job.label is None:
        raise RuntimeError(f"{log.name}: its truth cannot be prepared: {ended.failure}")
    return None if job.first is not None else failed(job.label, log, ended.failure)
