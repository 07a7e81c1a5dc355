"""Tasks on the workers of a dask scheduler; the one file that imports dask."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Generator, Mapping
from concurrent.futures import Future
from typing import TYPE_CHECKING, TypeVar

from bench.run.work import Attempts, Result, Task, perform, tried_twice

if TYPE_CHECKING:
    import distributed
    from distributed import Client

T = TypeVar("T")

TIME_OUT = 30.0  # s for the scheduler to answer


class DaskWorkers:
    """Workers of the scheduler at `address`, as in tcp://host:8786.

    A task whose worker died goes to another, as often as the scheduler's `allowed-failures` says.
    Dask counts that against every task the worker had in hand: those it gave up are tried again
    when all others are done, one at a time.

    Raises:
        ValueError: an address that is none, or workers of several threads.
        OSError: no dask scheduler answers there.
        LookupError: dask.distributed is not installed.
    """

    def __init__(self, address: str, time_out: float = TIME_OUT) -> None:
        self._client = _connected(address, time_out)
        self._address = address
        try:
            _check_threads(self._client)
        except ValueError:
            self.close()
            raise

    def finished(self, tasks: Mapping[str, Task]) -> Generator[tuple[str, Result], None, None]:
        """Each task's name and result, as they end.

        Raises:
            RuntimeError: the scheduler is gone, or its workers have other code.
        """
        return tried_twice(tasks, self._tried, self._tried_alone)

    def _tried(self, tasks: Mapping[str, Task], time: str = "first") -> Attempts:
        from distributed import as_completed

        if tasks:
            # their names are ours: what two clients ask for at once is done once
            names = {f"{key}-{time}": key for key in tasks}
            futures = self._client.map(
                perform, list(tasks.values()), list(tasks), key=list(names), pure=False
            )
            for future in as_completed(futures, loop=self._client.loop):
                yield names[future.key], self._result(future)

    def _tried_alone(self, tasks: Mapping[str, Task]) -> Attempts:
        for key, task in tasks.items():
            yield from self._tried({key: task}, "again")

    def close(self) -> None:
        """Leave; what of our tasks is not done yet is forgotten there."""
        self._client.close()

    def _result(self, future: distributed.Future[Result]) -> Result | str:
        from distributed import CancelledError, KilledWorker
        from distributed.comm.core import CommClosedError

        try:
            return future.result()
        except KilledWorker as error:
            return f"{error.allowed_failures + 1} dask workers, one after the other"
        except (CancelledError, CommClosedError, TimeoutError) as error:
            raise RuntimeError(
                f"the dask scheduler at {self._address} is gone; the results so far are kept: "
                "start again"
            ) from error
        except ImportError as error:
            raise RuntimeError(
                f"the dask workers of {self._address} lack a module of ours ({error}): "
                "install slams there, the same version as here"
            ) from error


def _connected(address: str, time_out: float) -> Client:
    try:
        from distributed import Client
        from distributed.comm.addressing import parse_address
        from distributed.comm.registry import get_backend
    except ImportError:
        raise LookupError(
            "--dask needs dask.distributed, which is not installed: pip install 'dask[distributed]'"
        ) from None
    # what matters arrives as exceptions; its log would bury our one sentence in tracebacks
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        get_backend(parse_address(address)[0])  # a client of no known scheme leaves a thread behind
        return _within(time_out, lambda: Client(address, timeout=time_out, set_as_default=False))
    except ValueError as error:
        raise ValueError(
            f"--dask: got {address!r} ({error}), expected an address such as tcp://host:8786"
        ) from error
    except Exception as error:  # whatever a server that is not dask's makes of our greeting
        raise OSError(
            f"--dask: no scheduler answers at {address} within {time_out:g} s; "
            "start one with: dask scheduler"
        ) from error


def _within(seconds: float, make: Callable[[], T]) -> T:
    """What `make` returns or raises; TimeoutError after that time. It is left to itself then.

    The client's own time-out does not end its wait for a server that accepts and says nothing.
    """
    made: Future[T] = Future()

    def _make() -> None:
        try:
            made.set_result(make())
        except Exception as error:
            made.set_exception(error)

    threading.Thread(target=_make, daemon=True).start()
    return made.result(seconds + 1.0)  # its own comes first where it works


def _check_threads(client: Client) -> None:
    """CPU time is of a process: tasks side by side in one would count each other's."""
    several = {worker: n for worker, n in client.nthreads().items() if n > 1}
    for worker, threads in several.items():
        raise ValueError(
            f"--dask: the worker {worker} has {threads} threads; "
            "start workers with: dask worker --nthreads 1 --nworkers N"
        )
