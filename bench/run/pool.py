"""Work in processes of their own: one that dies takes no other task along, none outlives this one.

Not concurrent.futures: there one dead process breaks the whole pool, and the processes of a parent
that was killed wait for ever.
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
PATIENCE = 2.0  # s for an idle process to end by itself before it is killed


class Ended(NamedTuple):
    """What came of a task: its value, or why there is none; whether its process died."""

    value: Any
    failure: str | None = None
    died: bool = False


def finished(
    tasks: dict[K, tuple[Callable[..., Any], tuple[Any, ...]]], workers: int, fresh: bool = True
) -> Generator[tuple[K, Ended], None, None]:
    """Tasks, each a function of a module and its arguments, as they end.

    `fresh` gives each task a process of its own: its memory and its compiler are its own. Else a
    process stays for many tasks.
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
            yield from ended  # the caller looks at these while the others work
            ended = []
            for worker in _answering(busy):
                ended.append((busy.pop(worker), answer := worker.answer()))
                if fresh or answer.died:
                    worker.end(PATIENCE)
                else:
                    idle.append(worker)
        yield from ended
    finally:
        _end_all(busy, idle)


def _answering(workers: Iterable[_Worker]) -> list[_Worker]:
    """Waits until some have an answer, or died."""
    by_connection = {worker.connection: worker for worker in workers}
    ready = wait(list(by_connection))
    return [worker for connection, worker in by_connection.items() if connection in ready]


def _end_all(busy: Iterable[_Worker], idle: Iterable[_Worker]) -> None:
    for worker in busy:
        worker.end(0.0)
    for worker in idle:
        worker.end(PATIENCE)


class _Worker:
    """A process that does one call after the other; it ends with this one, however that ends."""

    def __init__(self) -> None:
        self.connection, theirs = SPAWN.Pipe()
        self.process = SPAWN.Process(target=_serve, args=(theirs,))
        self.process.start()
        theirs.close()  # so that its end is seen here
        _WORKERS.add(self)

    def begin(self, call: tuple[Callable[..., Any], tuple[Any, ...]]) -> None:
        """Hand over a call; if nobody is there to take it, `answer` says so."""
        data = pickle.dumps(call)
        with suppress(OSError):
            self.connection.send_bytes(data)

    def answer(self) -> Ended:
        """What the call returned or raised."""
        try:
            return Ended(*pickle.loads(self.connection.recv_bytes()))
        except (EOFError, OSError):
            self.process.join()
            return Ended(None, _last_word(self.process.exitcode), died=True)

    def end(self, patience: float) -> None:
        """End the process; kill it if it takes longer than `patience` [s]."""
        self.connection.close()
        self.process.join(patience)
        if self.process.exitcode is None:
            self.process.kill()
            self.process.join()


_WORKERS: weakref.WeakSet[_Worker] = weakref.WeakSet()


@atexit.register  # after that of multiprocessing, so it runs before: that one would wait for ever
def _end_what_is_left() -> None:
    """After an exception nobody caught: its traceback keeps the work alive, and its workers."""
    _end_all(list(_WORKERS), ())


def _last_word(code: int | None) -> str:
    if code is not None and code < 0:
        return f"its process died (killed by {signal.Signals(-code).name})"
    return f"its process died (exit code {code})"


def _serve(connection: Connection) -> None:
    """The process: answers calls until nobody asks any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all; the parent decides
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            connection.send_bytes(_reply(connection.recv_bytes()))


def _end_with_parent() -> None:
    """A parent that is killed can tell nobody; what its tasks came to would reach nobody."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _reply(data: bytes) -> bytes:
    """A call, done: what it returned, and else what it raised, as text."""
    try:
        function, arguments = pickle.loads(data)
        return pickle.dumps((function(*arguments), None))
    except BaseException as error:
        return pickle.dumps((None, sentence(error)))


def sentence(error: BaseException) -> str:
    """The exception in one line, the same in every process: without addresses in memory."""
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return re.sub(r"0x[0-9a-f]+", "0x..", text)
