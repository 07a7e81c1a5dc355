"""Tasks on the workers of a dask scheduler; the one file that imports dask."""

from __future__ import annotations

import logging
from collections.abc import Generator, Mapping
from typing import TYPE_CHECKING

from bench.run.work import Result, Task, perform

if TYPE_CHECKING:
    from distributed import Client, Future

TIME_OUT = 30.0  # s for the scheduler to answer


class DaskWorkers:
    """Workers of the scheduler at `address`, as in tcp://host:8786.

    A task whose worker died goes to another, as often as the scheduler's `allowed-failures` says.

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
        from distributed import as_completed

        if tasks:
            keys = list(tasks)
            # their names are ours: what two clients ask for at once is done once
            futures = self._client.map(perform, list(tasks.values()), keys, key=keys, pure=False)
            for future in as_completed(futures):
                yield future.key, self._result(future)

    def close(self) -> None:
        """Leave; what of our tasks is not done yet is forgotten there."""
        self._client.close()

    def _result(self, future: Future[Result]) -> Result:
        from distributed import CancelledError, KilledWorker

        try:
            result: Result = future.result()
        except KilledWorker as error:
            return Result({"failed": f"its process died ({error})"}, kept=False)
        except (CancelledError, OSError) as error:
            raise RuntimeError(
                f"the dask scheduler at {self._address} is gone; the results so far are kept: "
                "start again"
            ) from error
        except ImportError as error:
            raise RuntimeError(
                f"the dask workers of {self._address} lack a module of ours ({error}): "
                "install slams there, the same version as here"
            ) from error
        return result


def _connected(address: str, time_out: float) -> Client:
    try:
        from distributed import Client
    except ImportError:
        raise LookupError(
            "--dask needs dask.distributed, which is not installed: pip install 'slams[cluster]'"
        ) from None
    # what matters arrives as exceptions; its log would bury our one sentence in tracebacks
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        return Client(address, timeout=time_out, set_as_default=False)
    except ValueError as error:
        raise ValueError(
            f"--dask: got {address!r} ({error}), expected an address such as tcp://host:8786"
        ) from error
    except Exception as error:  # whatever a server that is not dask's makes of our greeting
        raise OSError(
            f"--dask: no scheduler answers at {address} within {time_out:g} s; "
            "start one with: dask scheduler"
        ) from error


def _check_threads(client: Client) -> None:
    """CPU time is of a process: tasks side by side in one would count each other's."""
    several = {worker: n for worker, n in client.nthreads().items() if n > 1}
    for worker, threads in several.items():
        raise ValueError(
            f"--dask: the worker {worker} has {threads} threads; "
            "start workers with: dask worker --nthreads 1 --nworkers N"
        )
