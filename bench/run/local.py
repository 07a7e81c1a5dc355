"""Tasks in processes of this machine."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from dataclasses import dataclass

from bench.run import pool
from bench.run.work import Attempts, Result, Task, perform, tried_twice


@dataclass(frozen=True)
class LocalWorkers:
    """`jobs` processes, each for many tasks: kernels are loaded once.

    `fresh` gives each task a process of its own: what it costs is then its own, too. A task whose
    process died is tried again when all others are done, in a process of its own.
    """

    jobs: int
    fresh: bool = False

    def finished(self, tasks: Mapping[str, Task]) -> Generator[tuple[str, Result], None, None]:
        """Each task's name and result, as they end."""
        return tried_twice(
            tasks, lambda all_: self._tried(all_, self.fresh), lambda dead: self._tried(dead, True)
        )

    def close(self) -> None:
        """Nothing: the processes end with the work."""

    def _tried(self, tasks: Mapping[str, Task], fresh: bool) -> Attempts:
        calls = {key: (perform, (task, key)) for key, task in tasks.items()}
        with closing(pool.finished(calls, self.jobs, fresh)) as ended:
            for key, future in ended:
                yield key, _result(future)


def _result(future: Future[Result]) -> Result | str:
    try:
        return future.result()
    except BrokenProcessPool as error:
        return str(error)
