"""Where the work of a command is done: options --jobs, --shard and --dask. Light: help reads it."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from bench.run.shards import Shard
    from bench.run.work import Executor, Task

JOBS = min(2, os.cpu_count() or 1)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Give a command the options of where its runs are done."""
    group = parser.add_argument_group(
        "spreading the runs", "Whatever is chosen, the results are the same; see docs/clusters.md."
    )
    group.add_argument(
        "--jobs", type=int, metavar="N", help=f"processes of this machine; default: {JOBS}"
    )
    group.add_argument(
        "--shard",
        metavar="I/N",
        help="only part I of N, counted from 1; auto or auto/N: as the array job of SLURM, AWS "
        "Batch or Kubernetes says",
    )
    group.add_argument(
        "--dask",
        metavar="SCHEDULER",
        help="workers of the dask scheduler there, e.g. tcp://host:8786 (extra cluster)",
    )


class Spread(NamedTuple):
    """Who does the work, and which part of it; a context, as a cluster is to be left again."""

    executor: Executor
    shard: Shard | None

    def part(self, tasks: Iterable[Task]) -> list[Task]:
        """The tasks that are to be done here."""
        return list(tasks) if self.shard is None else self.shard.part(tasks)

    def __enter__(self) -> Spread:
        return self

    def __exit__(self, *_: object) -> None:
        self.executor.close()


def executor_of(arguments: argparse.Namespace) -> Spread:
    """What the options of `add_options` ask for; connects to the scheduler of --dask.

    Raises:
        ValueError: a number out of range, options that exclude each other.
        LookupError: dask is not installed.
        OSError: the scheduler does not answer within 30 s.
    """
    from bench.run.local import LocalWorkers
    from bench.run.shards import shard_of

    jobs = JOBS if arguments.jobs is None else arguments.jobs
    if jobs < 1:
        raise ValueError(f"--jobs: got {jobs}, expected 1 or more")
    shard = None if arguments.shard is None else shard_of(arguments.shard)
    if arguments.dask is None:
        return Spread(LocalWorkers(jobs), shard)
    if arguments.jobs is not None:
        raise ValueError("--jobs and --dask: got both, expected one (dask counts its own workers)")
    from bench.run.cluster import DaskWorkers

    return Spread(DaskWorkers(arguments.dask), shard)
