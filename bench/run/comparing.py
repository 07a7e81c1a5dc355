"""All runs of a comparison: every algorithm on every log, each in a process of its own."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from bench.judge.starts import start_scans, summarize_starts
from bench.results import LogResult, Outcome
from bench.results.arrays import unpack_outcome, unpack_reference
from bench.run.case_tasks import given, reference_task, run_task
from bench.run.cases import failed, relation_error
from bench.run.work import run_all
from slams import cli
from slams.types import Floats

if TYPE_CHECKING:
    from bench.run.cases import Choice
    from bench.run.store import Store
    from bench.run.work import Executor, Task
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


class Plan(NamedTuple):
    """A comparison before it is made: what is compared, and a task for every job."""

    labels: list[str]
    logs: list[ScanLog]
    wanted: Wanted
    tasks: dict[Job, Task]


def plan(
    labels: list[str],
    logs: list[ScanLog],
    choice: Choice,
    wanted: Wanted,
    machine: dict[str, Any],
) -> Plan:
    """Every algorithm on every log, in the order asked for; costs are those of `machine`.

    Raises:
        LookupError: no such algorithm, or one that has no source text to tell versions by.
        ValueError, TypeError: parameters that have no exact text.
    """
    tasks: dict[Job, Task] = {}
    # the last first: the baselines are slow, and a long case must not begin at the end
    for k, log in reversed(list(enumerate(logs))):
        it = given(log, wanted.relations)
        tasks[Job(None, k)] = reference_task(it)
        for label in reversed(labels):
            for first in (None, *_later_starts(log, wanted)):
                tasks[Job(label, k, first)] = run_task(it, label, choice, machine, first)
    for task in tasks.values():
        _ = task.key  # now, so that what has no name is told before the work
    return Plan(labels, logs, wanted, tasks)


def compared(what: Plan, store: Store, executor: Executor, quiet: bool) -> list[LogResult]:
    """Do the tasks that the store has no result of; everything that came of the comparison."""
    jobs = {task: job for job, task in what.tasks.items()}
    work = run_all(what.tasks.values(), store, executor)
    shown = cli.progress(work, len(jobs), "comparing", quiet, unit="run")
    found = {jobs[task]: _result(jobs[task], what, value) for task, value in shown}
    return [
        LogResult(found[Job(None, k)], [_outcome(found, label, k, what) for label in what.labels])
        for k in range(len(what.logs))
    ]


def _later_starts(log: ScanLog, wanted: Wanted) -> list[int]:
    """The scans to begin at besides the first."""
    if wanted.relations is None or wanted.starts < 2:
        return []
    return [int(first) for first in start_scans(len(log), wanted.starts)[1:]]


def _outcome(found: dict[Job, Any], label: str, k: int, what: Plan) -> Outcome:
    """The run from the first scan, with the spread over all starts where there are several."""
    outcome: Outcome = found[Job(label, k)]
    later = [found[job] for job in what.tasks if (job.label, job.k) == (label, k) and job.first]
    if not later or outcome.row["failed"]:
        return outcome
    errors = [relation_error(outcome), *later]
    limit = what.wanted.limit_m
    starts = summarize_starts(errors, limit)._asdict() | {"limit_m": limit}
    return replace(outcome, row=outcome.row | {"starts": starts})


def _result(job: Job, what: Plan, value: dict[str, Any]) -> Any:
    """What came of a job; a run that failed, or whose process died, leaves the others as they are.

    Raises:
        RuntimeError: nothing is known of the log; there is nothing to compare with.
    """
    log, reason = what.logs[job.k], value.get("failed")
    if job.label is None:
        if reason:
            raise RuntimeError(f"{log.name}: its truth cannot be prepared: {reason}")
        return unpack_reference(value["reference"])
    if job.first is not None:
        return value.get("error_m")
    return failed(job.label, log, reason) if reason else unpack_outcome(value["outcome"])
