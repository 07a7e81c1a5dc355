"""All runs of a comparison: every algorithm on every log, each in a process of its own."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from typing import TYPE_CHECKING, Any, NamedTuple

from bench.results import LogResult, Outcome
from bench.run.cases import run_case
from bench.run.pool import finished
from bench.run.reference import reference
from slams import cli

if TYPE_CHECKING:
    from concurrent.futures import Future

    from bench.run.cases import Choice
    from slams.scanlog import ScanLog
    from slams.types import Floats


class Job(NamedTuple):
    """One algorithm on the k-th log; no algorithm: what else is known of the log."""

    label: str | None
    k: int


def run_all(
    labels: list[str],
    logs: list[ScanLog],
    choice: Choice,
    relations: Floats | None,
    jobs: int,
    quiet: bool,
) -> list[LogResult]:
    """Every algorithm on every log, in the order asked for."""
    tasks: dict[Job, tuple[Callable[..., Any], tuple[Any, ...]]] = {}
    # the last first: the baselines are slow, and a long case must not begin at the end
    for k, log in reversed(list(enumerate(logs))):
        tasks[Job(None, k)] = reference, (log,)
        for label in reversed(labels):
            tasks[Job(label, k)] = run_case, (label, log, choice, relations)
    shown = cli.progress(finished(tasks, jobs), len(tasks), "comparing", quiet, unit="run")
    found = {job: _result(job, logs[job.k], future) for job, future in shown}
    return [
        LogResult(found[Job(None, k)], [found[Job(label, k)] for label in labels])
        for k in range(len(logs))
    ]


def _result(job: Job, log: ScanLog, future: Future[Any]) -> Any:
    """What came of a job; a process that died is a failed run, the others still count."""
    try:
        return future.result()
    except BrokenProcessPool as error:
        if job.label is None:
            raise
        reason = f"its process died ({error})"
        return Outcome({"algorithm": job.label, "log": log.name, "failed": reason})
