"""Runs as pure functions: the name of a task is a hash of all its inputs.

    task = Task("bench.run.some:run", {"log": sha256, "algorithm": "tsd", "seed": 3}, ("slams",))
    for key, value in run_all({task.key: task}, Store("results/sweep"), jobs=2):
        ...

Tasks with a result in the store are not run again: an interrupted sweep continues, and machines can
share the work.
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

# failures of the machine, not of the algorithm: reported, but not kept
MACHINE_ERRORS = (MemoryError, OSError, ImportError)


class Result(NamedTuple):
    """The return value of a task's function.

    `value` depends on the task only; `measured` (CPU time, memory) also on the machine. A result
    that is not `kept` is computed again at the next start.
    """

    value: dict[str, Any]
    measured: dict[str, Any] | None = None
    kept: bool = True


@dataclass(frozen=True, eq=False)
class Task:
    """One run.

    `function` is "module:function", called with `what` and `where` as keywords; it returns a
    `Result`. `what` contains all inputs as JSON: hashes of logs, parameters, seeds. `packages` are
    those whose code affects the result. `where` contains local paths, which are not part of the
    name.

    Raises:
        ValueError, TypeError: from `key`, if `what` is not valid JSON.
    """

    function: str
    what: Mapping[str, Any]
    packages: tuple[str, ...] = ()
    where: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def key(self) -> str:
        """The name of the result: a hash of the function, its inputs and the code."""
        return self.key_for(code_version(self.packages))

    def key_for(self, code: str) -> str:
        """The name for a version of the code."""
        known = {"function": self.function, "what": self.what, "code": code}
        return digest(canonical(known))


def run_all(
    tasks: Mapping[str, Task], store: Store, jobs: int
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Run tasks by their keys in `jobs` processes, and yield and store each value as it ends.

    A process runs many tasks, so that kernels are loaded once. The value of a failed run has the
    reason in "failed"; it is not stored if the process died.

    Raises:
        RuntimeError: a result cannot be written, or the code has changed; earlier results are
            kept.
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
    """Run a task; an exception of the algorithm is its result.

    Raises:
        RuntimeError: the local code differs from the code of the name `key`.
        TypeError: the returned value is not valid JSON.
    """
    _check_code(task, key)
    module, _, attribute = task.function.partition(":")
    function: Callable[..., Result] = getattr(importlib.import_module(module), attribute)
    try:
        result = function(**task.what, **task.where)
    except MACHINE_ERRORS as error:
        return Result({"failed": sentence(error)}, kept=False)
    except (Exception, SystemExit) as error:  # an external algorithm may raise anything
        return Result({"failed": sentence(error)})
    return Result(plain(result.value), plain(result.measured), result.kept)


def _check_code(task: Task, key: str) -> None:
    """Check the code: a process that started later or on another machine may have other code."""
    with suppress(LookupError):
        if task.key_for(code_version(task.packages)) == key:
            return
    raise RuntimeError(
        f"{platform.node()} does not have the code with which the sweep started "
        f"({', '.join(task.packages)}, numpy, numba ...): install the same versions everywhere, "
        "do not change the code meanwhile, and start again"
    )
