"""Tasks in processes of this machine."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from dataclasses import dataclass

from bench.run import pool
from bench.run.work import Result, Task, perform


@dataclass(frozen=True)
class LocalWorkers:
    """`jobs` processes, each for many tasks: kernels are loaded once.

    A task whose process died is tried again when all others are done, in a process of its own.
    """

    jobs: int

    def finished(self, tasks: Mapping[str, Task]) -> Generator[tuple[str, Result], None, None]:
        """Each task's name and result, as they end."""
        again: dict[str, Task] = {}
        with closing(self._tried(tasks, fresh=False)) as ended:
            for key, future in ended:
                if isinstance(future.exception(), BrokenProcessPool):
                    again[key] = tasks[key]
                else:
                    yield key, future.result()
        with closing(self._tried(again, fresh=True)) as ended:
            for key, future in ended:
                yield key, _result(future)

    def close(self) -> None:
        """Nothing: the processes end with the work."""

    def _tried(
        self, tasks: Mapping[str, Task], fresh: bool
    ) -> Generator[tuple[str, Future[Result]], None, None]:
        calls = {key: (perform, (task, key)) for key, task in tasks.items()}
        return pool.finished(calls, self.jobs, fresh)


def _result(future: Future[Result]) -> Result:
    try:
        return future.result()
    except BrokenProcessPool as error:
        return Result({"failed": f"its process died ({error})"}, kept=False)
