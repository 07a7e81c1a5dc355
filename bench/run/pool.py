"""Work in processes of its own: each task starts fresh, its memory and its compiler are its own."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Hashable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from typing import Any, TypeVar

K = TypeVar("K", bound=Hashable)


def finished(
    tasks: dict[K, tuple[Callable[..., Any], tuple[Any, ...]]], workers: int
) -> Iterator[tuple[K, Future[Any]]]:
    """Tasks, each a function of a module and its arguments, as they end."""
    size = max(1, min(workers, len(tasks)))
    with ThreadPoolExecutor(size) as waiting:
        futures = {waiting.submit(_alone, *task): key for key, task in tasks.items()}
        try:
            for future in as_completed(futures):
                yield futures[future], future
        finally:
            waiting.shutdown(wait=True, cancel_futures=True)


def _alone(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """A task in a pool of one process: of a pool of several, one that dies takes the others along.

    Spawned, not forked: threads of libraries do not survive a fork.
    """
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()
