"""Tasks in separate processes: a process that dies affects no other task, none outlives this one.

This is not concurrent.futures, where one dead process breaks the pool, and the processes of a
killed parent wait forever.
"""

from __future__ import annotations

import atexit
import multiprocessing
import os
import pickle
import re
import signal
import threading
import weakref
from collections.abc import Callable, Generator, Hashable, Iterable
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.process import parent_process
from typing import Any, NamedTuple, TypeVar

K = TypeVar("K", bound=Hashable)

SPAWN = multiprocessing.get_context("spawn")  # threads of libraries do not survive a fork
EXIT_TIMEOUT = 2.0  # s for an idle process to end before it is killed


class Ended(NamedTuple):
    """The result of a task: its value, or the reason of its failure; whether its process died."""

    value: Any
    failure: str | None = None
    died: bool = False


def finished(
    tasks: dict[K, tuple[Callable[..., Any], tuple[Any, ...]]], workers: int, fresh: bool = True
) -> Generator[tuple[K, Ended], None, None]:
    """Run tasks, each a module's function and its arguments, and yield them as they end.

    `fresh` runs each task in a new process, with its own memory and compiler. Else a process runs
    many tasks.
    """
    todo = list(reversed(tasks.items()))
    idle: list[_Worker] = []
    busy: dict[_Worker, K] = {}
    ended: list[tuple[K, Ended]] = []
    try:
        while todo or busy:
            while todo and len(busy) < max(1, workers):
                worker = idle.pop() if idle else _Worker()
                key, call = todo.pop()
                busy[worker] = key
                worker.begin(call)
            yield from ended  # the caller uses these while the others run
            ended = []
            for worker in _ready(busy):
                ended.append((busy.pop(worker), answer := worker.answer()))
                if fresh or answer.died:
                    worker.end(EXIT_TIMEOUT)
                else:
                    idle.append(worker)
        yield from ended
    finally:
        _end_all(busy, idle)


def _ready(workers: Iterable[_Worker]) -> list[_Worker]:
    """Wait for workers that answered or died."""
    by_connection = {worker.connection: worker for worker in workers}
    ready = wait(list(by_connection))
    return [worker for connection, worker in by_connection.items() if connection in ready]


def _end_all(busy: Iterable[_Worker], idle: Iterable[_Worker]) -> None:
    for worker in busy:
        worker.end(0.0)
    for worker in idle:
        worker.end(EXIT_TIMEOUT)


class _Worker:
    """A process for one call after the other; it ends with this process in any case."""

    def __init__(self) -> None:
        self.connection, theirs = SPAWN.Pipe()
        self.process = SPAWN.Process(target=_serve, args=(theirs,))
        self.process.start()
        theirs.close()  # the connection then closes when the process ends
        _WORKERS.add(self)

    def begin(self, call: tuple[Callable[..., Any], tuple[Any, ...]]) -> None:
        """Send a call; if the process is dead, `answer` returns the failure."""
        data = pickle.dumps(call)
        with suppress(OSError):
            self.connection.send_bytes(data)

    def answer(self) -> Ended:
        """The returned value or the exception of the call."""
        try:
            return Ended(*pickle.loads(self.connection.recv_bytes()))
        except (EOFError, OSError):
            self.process.join()
            return Ended(None, _death_words(self.process.exitcode), died=True)

    def end(self, timeout: float) -> None:
        """End the process; kill it after `timeout` [s]."""
        self.connection.close()
        self.process.join(timeout)
        if self.process.exitcode is None:
            self.process.kill()
            self.process.join()


_WORKERS: weakref.WeakSet[_Worker] = weakref.WeakSet()


@atexit.register  # registered after multiprocessing's handler, so it runs before that waits
def _end_remaining() -> None:
    """End the workers after an uncaught exception, whose traceback keeps them alive."""
    _end_all(list(_WORKERS), ())


def _death_words(code: int | None) -> str:
    if code is not None and code < 0:
        return f"its process died (killed by {signal.Signals(-code).name})"
    return f"its process died (exit code {code})"


def _serve(connection: Connection) -> None:
    """Main loop of a process: answer calls until the connection closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            connection.send_bytes(_reply(connection.recv_bytes()))


def _end_with_parent() -> None:
    """Exit when the parent process ends, even if it was killed."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _reply(data: bytes) -> bytes:
    """Run a call; the pickled value and the exception as text."""
    try:
        function, arguments = pickle.loads(data)
        return pickle.dumps((function(*arguments), None))
    except BaseException as error:
        return pickle.dumps((None, sentence(error)))


def sentence(error: BaseException) -> str:
    """The exception in one line, without memory addresses, which differ between processes."""
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return re.sub(r"0x[0-9a-f]+", "0x..", text)
