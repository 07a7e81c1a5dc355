"""What a run costs: time per scan, memory, and what a live node would have had to drop.

The time per scan is that of `update` alone; `overheads` has what a run or a node needs besides.
"""

from __future__ import annotations

import contextlib
import math
import os
import platform
import time
from collections.abc import Callable, Generator, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from slams import summary
from slams.cli import THREADS
from slams.live import LiveSlam
from slams.params import Params
from slams.registry import find
from slams.scanlog import ScanLog
from slams.types import Floats, Scan, Slam

STATUS = Path("/proc/self/status")
PEAK_RESET = Path("/proc/self/clear_refs")
DRAWINGS = 3  # of the map, the first of which may compile


def cost(seconds: Floats, duration: float, slower: float) -> dict[str, float]:
    """`slams.summary.cost`, and the real-time factor of a core `slower` times slower."""
    found = summary.cost(seconds, duration)
    factor = found["real_time_factor"] / slower
    return found | {"real_time_factor_slower": factor, "slower": slower}


def overheads(label: str, log: ScanLog, params: Params, scans: int = 200) -> dict[str, float]:
    """CPU time [ms] that the time per scan leaves out, over the first `scans` of a log.

    - iterate_ms: a `Scan` from the log's arrays, odometry and heading looked up.
    - live_push_ms: what `LiveSlam.push` takes more than `update`: a clean copy of the ranges, the
      covariance, the algorithm's counts. Of a push and an update of two instances that see the
      same scans, without the gyro, by turns the one or the other first: the median difference of
      each order, and the mean of both, as whoever comes first finds the caches cold.
    - map_ms: drawing the map as it stands after them; median.
    """
    part = log.select(scans)
    start = time.process_time()
    seen = list(part)
    iterating = time.process_time() - start
    slam: Slam = find(label).cls(params)
    live = LiveSlam(label, mount=log.laser.mount, warm_up=False, **params.as_dict())
    more = [_push_less_update(live, slam, scan, k % 2 == 0) for k, scan in enumerate(seen)]
    orders = more[::2], more[1::2]
    drawing = [_seconds(slam.map) for _ in range(DRAWINGS)]
    return {
        "iterate_ms": 1e3 * iterating / len(seen),
        "live_push_ms": 1e3 * float(np.mean([np.median(order) for order in orders if order])),
        "map_ms": 1e3 * float(np.median(drawing)),
    }


def _push_less_update(live: LiveSlam, slam: Slam, scan: Scan, push_first: bool) -> float:
    """How much longer [s] a push takes than an update with the same scan."""
    scan, laser = replace(scan, yaw=None), scan.laser
    geometry = (laser.angle_min, laser.angle_increment, laser.range_min, laser.range_max)

    def push() -> None:
        """As a node does it."""
        live.push(
            scan.t,
            scan.ranges,
            *geometry,
            time_increment=laser.time_increment,
            odometry=scan.odometry,
        )

    def update() -> None:
        """As a replay does it."""
        slam.update(scan)

    works = (push, update) if push_first else (update, push)
    first, second = (_seconds(work) for work in works)
    return first - second if push_first else second - first


def _seconds(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


class PeakMemory:
    """Context that measures how far the memory of this process rises [MB] above its start.

    `mb` is None where the system does not tell (it needs Linux' /proc).
    """

    mb: float | None = None

    def __enter__(self) -> PeakMemory:
        with contextlib.suppress(OSError):
            PEAK_RESET.write_text("5")
        self._before = _status("VmRSS")
        return self

    def __exit__(self, *_: object) -> None:
        peak = _status("VmHWM")
        if peak is not None and self._before is not None:
            self.mb = max(peak - self._before, 0.0)


def resident_mb() -> float:
    """Memory of this process that is in use now [MB]; nan where the system does not tell."""
    found = _status("VmRSS")
    return math.nan if found is None else found


def _status(key: str) -> float | None:
    """A line of /proc/self/status [MB]."""
    try:
        text = STATUS.read_text()
    except OSError:
        return None
    line = next((line for line in text.splitlines() if line.startswith(f"{key}:")), None)
    return None if line is None else int(line.split()[1]) / 1024.0


class LiveScans:
    """The scans a live node would get: while it works on one, all but the newest are dropped.

    A scan arrives at its stamp. The time between two draws from the iterator is the node's work,
    as CPU time of this process, times `slower`. Which scans are dropped depends on the machine.
    """

    def __init__(self, log: ScanLog, slower: float = 1.0) -> None:
        self.log, self.slower = log, slower
        self.dropped = 0

    def __iter__(self) -> Iterator[Scan]:
        free = -np.inf
        waiting: Scan | None = None
        for scan in self.log:
            if waiting is not None and scan.t > free:
                free = yield from self._work(waiting, free)
            elif waiting is not None:
                self.dropped += 1
            waiting = scan
        if waiting is not None:
            yield waiting

    def _work(self, scan: Scan, free: float) -> Generator[Scan, None, float]:
        """Hand out a scan; returns when the node is free again."""
        start = time.process_time()
        yield scan
        return max(scan.t, free) + self.slower * (time.process_time() - start)


def machine() -> dict[str, Any]:
    """The machine of the run, as far as the system tells."""
    cpu = platform.processor() or platform.machine()
    with contextlib.suppress(OSError, StopIteration):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        cpu = next(ln for ln in lines if ln.startswith("model name")).partition(":")[2].strip()
    threads = {name: os.environ.get(name) for name in THREADS}
    return {"cpu": cpu, "system": platform.system(), "threads": threads}
