"""Where the work of a command is done: options --jobs and --shard. Light: help reads it."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from bench.run.work import Executor, Task

JOBS = min(2, os.cpu_count() or 1)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Give a command the options of where its runs are done."""
    group = parser.add_argument_group(
        "spreading the runs", "The results do not depend on these options; see docs/field.md."
    )
    group.add_argument(
        "--jobs",
        type=int,
        metavar="N",
        default=JOBS,
        help="number of processes (default: %(default)s)",
    )
    group.add_argument(
        "--shard",
        metavar="I/N",
        help="do only part I of N, counted from 1; one part for each machine",
    )


@dataclass(frozen=True)
class Shard:
    """Part `index` of `count`, counted from 1.

    A task belongs to one shard by its name alone: what else is in the list plays no part.
    """

    index: int
    count: int

    def part(self, tasks: Iterable[Task]) -> list[Task]:
        """The tasks that are this shard's."""
        return [task for task in tasks if int(task.key, 16) % self.count == self.index - 1]


class Spread(NamedTuple):
    """Who does the work, and which part of it."""

    executor: Executor
    shard: Shard | None

    def part(self, tasks: Iterable[Task]) -> list[Task]:
        """The tasks that are to be done here."""
        return list(tasks) if self.shard is None else self.shard.part(tasks)


def executor_of(arguments: argparse.Namespace) -> Spread:
    """What the options of `add_options` ask for.

    Raises:
        ValueError: a number out of range, or a shard of another form than I/N.
    """
    from bench.run.work import LocalWorkers

    if arguments.jobs < 1:
        raise ValueError(f"--jobs: got {arguments.jobs}, expected 1 or more")
    shard = None if arguments.shard is None else _shard_of(arguments.shard)
    return Spread(LocalWorkers(arguments.jobs), shard)


def _shard_of(text: str) -> Shard:
    numbers = text.split("/")
    if len(numbers) == 2 and all(n.isascii() and n.isdecimal() for n in numbers):
        shard = Shard(*map(int, numbers))
        if 1 <= shard.index <= shard.count:
            return shard
    raise ValueError(f"--shard: got {text!r}, expected I/N from 1/N to N/N")
