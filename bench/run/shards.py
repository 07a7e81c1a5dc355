"""A shard: one machine's part of the work, the same whenever and wherever it is asked for."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from bench.run.work import Task


@dataclass(frozen=True)
class Array:
    """How a scheduler of clusters numbers the jobs of an array: names of environment variables."""

    index: str
    first: str  # "" = counts from 0
    step: str  # "" = counts by 1
    count: str  # "" = does not tell


ARRAYS = {
    "SLURM": Array(
        "SLURM_ARRAY_TASK_ID",
        "SLURM_ARRAY_TASK_MIN",
        "SLURM_ARRAY_TASK_STEP",
        "SLURM_ARRAY_TASK_COUNT",
    ),
    "AWS Batch": Array("AWS_BATCH_JOB_ARRAY_INDEX", "", "", "AWS_BATCH_JOB_ARRAY_SIZE"),
    "Kubernetes": Array("JOB_COMPLETION_INDEX", "", "", ""),
}
FORM = "I/N from 1/N to N/N, auto, or auto/N"


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


def shard_of(text: str, environment: Mapping[str, str] = os.environ) -> Shard:
    """The shard that `--shard` asks for: I/N, or auto for what the cluster's scheduler says.

    Raises:
        ValueError: no such form, an index out of range, or no array job around.
    """
    index, _, count = text.partition("/")
    if index == "auto":
        return _checked(text, *_of_array(count, environment))
    if not (_is_number(index) and _is_number(count)):
        raise ValueError(f"--shard: got {text!r}, expected {FORM}")
    return _checked(text, int(index), int(count))


def _of_array(count: str, environment: Mapping[str, str]) -> tuple[int, int]:
    """Index from 1 and count, by the first scheduler that set its variables."""
    for array in ARRAYS.values():
        if array.index in environment:
            return _place(array, count, environment)
    raise ValueError(
        f"--shard auto: not within an array job of {', '.join(ARRAYS)}; expected one of the "
        f"variables {', '.join(a.index for a in ARRAYS.values())}, or --shard I/N"
    )


def _place(array: Array, count: str, environment: Mapping[str, str]) -> tuple[int, int]:
    """With a count given, SLURM's numbers are taken to be from 1 to it."""
    index = _variable(array.index, environment)
    if count:
        return index + (0 if array.first else 1), _count(count)
    if not array.count:
        raise ValueError(f"--shard auto: {array.index} tells no count; expected --shard auto/N")
    first = _variable(array.first, environment) if array.first else 0
    step = _variable(array.step, environment) if array.step in environment else 1
    place, rest = divmod(index - first, max(step, 1))
    if rest or place >= _variable(array.count, environment):
        raise ValueError(
            f"--shard auto: {array.index} {index} is of an array with gaps; expected a range "
            "such as 1-100, or --shard auto/N with numbers from 1 to N"
        )
    return place + 1, _variable(array.count, environment)


def _variable(name: str, environment: Mapping[str, str]) -> int:
    value = environment.get(name, "")
    if not _is_number(value):
        raise ValueError(f"--shard auto: {name} is {value!r}, expected a number")
    return int(value)


def _count(text: str) -> int:
    if not _is_number(text):
        raise ValueError(f"--shard: got {text!r} after auto/, expected a number of shards")
    return int(text)


def _is_number(text: str) -> bool:
    return text.isascii() and text.isdecimal()


def _checked(text: str, index: int, count: int) -> Shard:
    if not 1 <= index <= count:
        raise ValueError(f"--shard {text}: got part {index} of {count}, expected {FORM}")
    return Shard(index, count)
