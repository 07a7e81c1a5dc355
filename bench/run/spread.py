"""Where the work of a command is done: options --jobs and --shard. Light: help reads it."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bench.run.work import Task

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

    index: int = 1
    count: int = 1

    def part(self, tasks: Iterable[Task]) -> list[Task]:
        """The tasks that are this shard's."""
        return [task for task in tasks if int(task.key, 16) % self.count == self.index - 1]


def shard_of(arguments: argparse.Namespace) -> Shard:
    """The part that the options of `add_options` ask for; without --shard all.

    Raises:
        ValueError: a number out of range, or a shard of another form than I/N.
    """
    if arguments.jobs < 1:
        raise ValueError(f"--jobs: got {arguments.jobs}, expected 1 or more")
    if arguments.shard is None:
        return Shard()
    numbers = arguments.shard.split("/")
    if len(numbers) == 2 and all(n.isascii() and n.isdecimal() for n in numbers):
        shard = Shard(*map(int, numbers))
        if 1 <= shard.index <= shard.count:
            return shard
    raise ValueError(f"--shard: got {arguments.shard!r}, expected I/N from 1/N to N/N")
