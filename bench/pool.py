"""Work in processes of its own: each task starts fresh, its memory and its compiler are its own."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Hashable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from typing import Any, TypeVar

K = TypeVar("K", bound=Hashable)


def finished(
    tasks: dict[K, tuple[Callable[..., Any], tuple[Any, ...]]], workers: int
) -> Iterator[tuple[K, Future[Any]]]:
    """Tasks, each a function of a module and its arguments, as they end.

    Spawned, not forked: threads of libraries do not survive a fork.
    """
    context = multiprocessing.get_context("spawn")
    size = max(1, min(workers, len(tasks)))
    with ProcessPoolExecutor(size, mp_context=context, max_tasks_per_child=1) as pool:
        futures = {
            pool.submit(function, *arguments): key for key, (function, arguments) in tasks.items()
        }
        try:
            for future in as_completed(futures):
                yield futures[future], future
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
