"""All runs of a comparison: every algorithm on every log, each in a process of its own."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from bench.judge.starts import start_scans, summarize_starts
from bench.results import LogResult, Outcome
from bench.run.cases import relation_error, run_case, start_case
from bench.run.pool import finished
from bench.run.reference import reference
from slams import cli
from slams.types import Floats

if TYPE_CHECKING:
    from concurrent.futures import Future

    from bench.run.cases import Choice
    from slams.scanlog import ScanLog


class Job(NamedTuple):
    """One algorithm on the k-th log; no algorithm: what else is known of the log.

    `first` is the scan it begins at, where it is run from several.
    """

    label: str | None
    k: int
    first: int | None = None


class Wanted(NamedTuple):
    """What is asked for besides the runs: relations, from so many start scans, their limit [m]."""

    relations: Floats | None = None
    starts: int = 1
    limit_m: float = 0.03


def run_all(
    labels: list[str],
    logs: list[ScanLog],
    choice: Choice,
    wanted: Wanted,
    jobs: int,
    quiet: bool,
) -> list[LogResult]:
    """Every algorithm on every log, in the order asked for."""
    tasks: dict[Job, tuple[Callable[..., Any], tuple[Any, ...]]] = {}
    # the last first: the baselines are slow, and a long case must not begin at the end
    for k, log in reversed(list(enumerate(logs))):
        tasks[Job(None, k)] = reference, (log,)
        for label in reversed(labels):
            tasks[Job(label, k)] = run_case, (label, log, choice, wanted.relations)
            for first in _later_starts(log, wanted):
                given = (label, log, choice, wanted.relations, first)
                tasks[Job(label, k, first)] = start_case, given
    shown = cli.progress(finished(tasks, jobs), len(tasks), "comparing", quiet, unit="run")
    found = {job: _result(job, logs[job.k], future) for job, future in shown}
    return [
        LogResult(found[Job(None, k)], [_outcome(found, label, k, wanted) for label in labels])
        for k in range(len(logs))
    ]


def _later_starts(log: ScanLog, wanted: Wanted) -> list[int]:
    """The scans to begin at besides the first."""
    if wanted.relations is None or wanted.starts < 2:
        return []
    return [int(first) for first in start_scans(len(log), wanted.starts)[1:]]


def _outcome(found: dict[Job, Any], label: str, k: int, wanted: Wanted) -> Outcome:
    """The run from the first scan, with the spread over all starts where there are several."""
    outcome: Outcome = found[Job(label, k)]
    later = [
        error for job, error in found.items() if (job.label, job.k) == (label, k) and job.first
    ]
    if not later or outcome.row["failed"]:
        return outcome
    errors = [relation_error(outcome), *later]
    starts = summarize_starts(errors, wanted.limit_m)._asdict() | {"limit_m": wanted.limit_m}
    return replace(outcome, row=outcome.row | {"starts": starts})


def _result(job: Job, log: ScanLog, future: Future[Any]) -> Any:
    """What came of a job; a process that died is a failed run, the others still count."""
    try:
        return future.result()
    except BrokenProcessPool as error:
        if job.label is None:
            raise
        if job.first is not None:
            return None
        reason = f"its process died ({error})"
        return Outcome({"algorithm": job.label, "log": log.name, "failed": reason})
