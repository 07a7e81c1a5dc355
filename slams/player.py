"""The loop over the scans of a log, and its result."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slams.params import Params
from slams.types import Corrected, Floats, Scan, Slam

# of a report; all other numbers are counts
STATE_KEYS = {"particles", "tiles", "stamps_late_ms", "attitude_late_ms"}

WARM_UP_SCANS = 4  # after so many all kernels that a typical scan needs are loaded


@dataclass(frozen=True)
class Run:
    """The result of one replay.

    `t` (n,) [s]; `poses` (n, 3) x, y [m], theta [rad] in the map frame, each after its update;
    `seconds` (n,) CPU time of each update without compilation; `compile_s` CPU seconds of
    compilation; `report` of the algorithm; `says_lost` (n,) scans after which it reported to be
    lost; `corrected` (n, 3) poses at the end, if the algorithm closes loops.
    """

    t: Floats
    poses: Floats
    seconds: Floats
    compile_s: float
    report: dict[str, Any]
    says_lost: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, np.bool_))
    corrected: Floats | None = None

    def __len__(self) -> int:
        return len(self.t)

    @property
    def final(self) -> Floats:
        """The poses (n, 3) at the end: corrected by loops, if the algorithm closes them."""
        return self.poses if self.corrected is None else self.corrected


def replay(slam: Slam, scans: Iterable[Scan]) -> Run:
    """Give every scan in order to `slam`, and measure the CPU time of each update.

    Raises:
        RuntimeError: the algorithm broke its contract: a pose is not finite.
    """
    from slams.jit import CompileClock

    t, poses, seconds = [], [], []
    before = dict(slam.report())  # of a resumed state
    lost = [int(before.get("lost", 0))]
    with CompileClock() as compiling, _frozen_objects():
        for scan in scans:
            compiled, start = compiling.seconds, time.process_time()
            poses.append(slam.update(scan))
            seconds.append(time.process_time() - start - (compiling.seconds - compiled))
            t.append(scan.t)
            lost.append(int(slam.report().get("lost", 0)))
    trajectory = np.array(poses, np.float64).reshape(-1, 3)
    bad = np.flatnonzero(~np.isfinite(trajectory).all(axis=1))
    if bad.size:
        raise RuntimeError(f"{type(slam).__name__} returned {poses[bad[0]]} for scan {bad[0]}")
    return Run(
        np.array(t),
        trajectory,
        np.maximum(seconds, 0.0),
        compiling.seconds,
        counts_since(before, slam.report()),
        np.diff(lost) > 0,
        slam.corrected()[-len(t) :] if isinstance(slam, Corrected) else None,
    )


def counts_since(before: Mapping[str, Any], report: Mapping[str, Any]) -> dict[str, Any]:
    """A report with the counts of scans since an earlier report."""
    counts = {k: n for k, n in before.items() if isinstance(n, int) and k not in STATE_KEYS}
    return {k: value - counts[k] if k in counts else value for k, value in report.items()}


@contextmanager
def _frozen_objects() -> Iterator[None]:
    """Exclude all present objects from garbage collection, which takes 40 ms for them."""
    if gc.get_freeze_count():  # the caller has done so, for many runs
        yield
        return
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def warm_up(slam_class: type[Slam], params: Params, scans: Iterable[Scan]) -> float:
    """CPU seconds of a few scans on a temporary instance, which loads or compiles its kernels."""
    start = time.process_time()
    slam = slam_class(params)
    for scan in scans:
        slam.update(scan)
    return time.process_time() - start
