"""Runs for tests of where runs are done: each leaves a line in a log as it begins."""

import os
import pickle
import time
from pathlib import Path

from bench.run import pool
from bench.run.pool import Ended
from bench.run.work import Result


def _begin(n, log, who):
    with Path(log).open("a") as file:
        file.write(f"{who} {os.getpid()} {n}\n")


def run(n, seconds=0.0, log=os.devnull, who=0):
    _begin(n, log, who)
    time.sleep(seconds)
    return Result({"n": n, "third": n / 3.0, "square": n * n}, {"pid": os.getpid()})


def raises(n):
    raise ZeroDivisionError(f"at {n}, by {object()!r}")


def leaves(n):
    raise SystemExit(f"enough of {n}")


def lacks_memory(n):
    raise MemoryError(f"for {n}")


def exits(n, log=os.devnull):
    _begin(n, log, 0)
    os._exit(3)


def here(calls, workers, fresh=True):
    """What the pool does, in this process."""
    for key, call in calls.items():
        yield key, Ended(*pickle.loads(pool._reply(pickle.dumps(call))))
