"""Runs as pure functions: a task has a name that follows from all its result depends on.

    task = Task("bench.run.some:run", {"log": sha256, "algorithm": "tsd", "seed": 3}, ("slams",))
    for key, value in run_all({task.key: task}, Store("results/sweep"), jobs=2):
        ...

What has a result in the store need not be run again, so that a sweep that was killed goes on where
it was, and a machine that did a part has done it for all.
"""

from __future__ import annotations

import importlib
import platform
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

from bench.run import pool
from bench.run.pool import sentence
from bench.run.store import Store, canonical, code_version, digest, plain

# these tell of the machine, not of the algorithm: said, but not kept as its result
OF_THE_MACHINE = (MemoryError, OSError, ImportError)


class Result(NamedTuple):
    """What a task's function returns.

    `value` follows from the task alone; `measured` (CPU time, memory) also from the machine and
    the moment. What is not `kept` is run again next time.
    """

    value: dict[str, Any]
    measured: dict[str, Any] | None = None
    kept: bool = True


@dataclass(frozen=True, eq=False)
class Task:
    """One run.

    `function` is "module:function", called with `what` and `where` as keywords, and returns a
    `Result`. `what` has everything the result follows from, as JSON: contents of logs by their
    hash, parameters, seeds. `packages` are those whose code it follows from. `where` tells how to
    get at it on this machine, paths of logs for instance, and is no part of the name.

    Raises:
        ValueError, TypeError: from `key`, where `what` has something that JSON does not.
    """

    function: str
    what: Mapping[str, Any]
    packages: tuple[str, ...] = ()
    where: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def key(self) -> str:
        """The name of the result: a hash of the function, of what it is given and of the code."""
        return self.key_for(code_version(self.packages))

    def key_for(self, code: str) -> str:
        """The name with that version of the code."""
        known = {"function": self.function, "what": self.what, "code": code}
        return digest(canonical(known))


def run_all(
    tasks: Mapping[str, Task], store: Store, jobs: int
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Do tasks, by their keys, in `jobs` processes; each value as it ends, kept in the store.

    A process does many tasks: kernels are loaded once. A run that failed has a value with "failed",
    a sentence; that of a process that died is not kept.

    Raises:
        RuntimeError: a result cannot be written, or the code is another than that of the names;
            results before it are kept.
    """
    calls = {key: (perform, (task, key)) for key, task in tasks.items()}
    with closing(pool.finished(calls, jobs, fresh=False)) as ended:
        for key, found in ended:
            if found.failure and not found.died:
                raise RuntimeError(found.failure.removeprefix("RuntimeError: "))
            result = found.value or Result({"failed": found.failure}, kept=False)
            if result.kept:
                store.write(key, result.value, result.measured)
            yield key, result.value


def perform(task: Task, key: str) -> Result:
    """Do a task; what the algorithm raises is its result.

    Raises:
        RuntimeError: the code here is not the code that the task has its name `key` from.
        TypeError: the function returned what JSON does not have.
    """
    _check_code(task, key)
    module, _, attribute = task.function.partition(":")
    function: Callable[..., Result] = getattr(importlib.import_module(module), attribute)
    try:
        result = function(**task.what, **task.where)
    except OF_THE_MACHINE as error:
        return Result({"failed": sentence(error)}, kept=False)
    except (Exception, SystemExit) as error:  # an outsider's algorithm may raise anything
        return Result({"failed": sentence(error)})
    return Result(plain(result.value), plain(result.measured), result.kept)


def _check_code(task: Task, key: str) -> None:
    """A process that started late, or on another machine, may have other code."""
    with suppress(LookupError):
        if task.key_for(code_version(task.packages)) == key:
            return
    raise RuntimeError(
        f"{platform.node()} has not the code that the work was started with "
        f"({', '.join(task.packages)}, numpy, numba ...): install the same versions everywhere, "
        "change nothing meanwhile, and start again"
    )
