"""Long runs of one algorithm: half a million scans at rest, kilometers through a large building.

What a robot that is on for a day would find out: time per scan and memory as they grow.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bench.run.code import package_of, sources_with
from bench.run.timing import resident_mb
from bench.run.trial import content_of
from bench.run.work import Result, Task
from slams.metrics import ate
from slams.player import WARM_UP_SCANS, warm_up
from slams.registry import find
from slams.test_world import ROOM, cast, laser
from slams.types import IDENTITY, Floats, OccupancyGrid, Scan

if TYPE_CHECKING:
    from slams.scanlog import ScanLog
    from slams.types import Slam

HERE = "bench.run.soaking"
BEAMS, PERIOD, NOISE = 360, 0.1, 0.01  # [1, s, m] of the laser at rest
SAMPLE = 50  # scans between two looks at the memory
EARLY = 500.0  # [m] of the way with which its end is compared
STRETCH = 100.0  # [m] over which the time per scan is averaged
SHARE = 0.1  # of the scans at rest, the same


class Timed(NamedTuple):
    """A run: CPU time [s] (n,), poses (n, 3), resident memory [MB] above that at the start."""

    seconds: Floats
    poses: Floats
    resident: Floats


def tasks(
    labels: list[str], log: ScanLog | None, scans: int, machine: dict[str, Any]
) -> dict[tuple[str, str], Task]:
    """What there is to run: the way and the scans at rest of each algorithm.

    What a run costs is part of its result here, so the machine is part of its name.
    """
    found = {}
    content = None if log is None else content_of(log)
    for label in labels:
        packages = sources_with(package_of(find(label).cls))
        what = {"algorithm": label, "machine": machine}
        if log is not None:
            where = {"given": log}
            function = f"{HERE}:way_run"
            found["way", label] = Task(function, what | {"log": content}, packages, where)
        if scans:
            found["rest", label] = Task(f"{HERE}:rest_run", what | {"scans": scans}, packages)
    return found


def rest_run(algorithm: str, scans: int, **_: Any) -> Result:
    """Do a task of scans at rest."""
    return Result(rest(algorithm, scans))


def way_run(algorithm: str, given: ScanLog, **_: Any) -> Result:
    """Do a task of a way."""
    return Result(way(algorithm, given))


def rest(label: str, scans: int) -> dict[str, Any]:
    """An algorithm over scans of one place: time and memory at the beginning and at the end."""
    slam = _warm(label, at_rest(WARM_UP_SCANS))
    run = timed(slam, at_rest(scans), scans)
    part, samples = max(1, int(SHARE * scans)), max(1, int(SHARE * len(run.resident)))
    return {
        "algorithm": label,
        "scans": scans,
        "first_ms": 1e3 * float(run.seconds[:part].mean()),
        "last_ms": 1e3 * float(run.seconds[-part:].mean()),
        "longest_ms": 1e3 * float(run.seconds.max()),
        "first_mb": float(run.resident[:samples].max()),
        "last_mb": float(run.resident[-samples:].max()),
        "off_m": float(np.hypot(*run.poses[-1, :2])),
        "report": slam.report(),
    }


def at_rest(scans: int) -> Iterator[Scan]:
    """Scans of a robot that stands in a room, its wheels with it; seeded."""
    rng, lidar = np.random.default_rng(0), laser(BEAMS)
    exact = cast(ROOM, IDENTITY, lidar)
    for k in range(scans):
        ranges = (exact + NOISE * rng.standard_normal(BEAMS)).astype(np.float32)
        yield Scan(k * PERIOD, ranges, lidar, IDENTITY)


def way(label: str, log: ScanLog) -> dict[str, Any]:
    """An algorithm over a long log with a truth: time per scan early and at the end, memory."""
    truth = log.truth_at(log.t)
    if truth is None or len(log) <= WARM_UP_SCANS:
        raise ValueError(f"{log.name}: expected a log with a truth")
    slam = _warm(label, log.select(WARM_UP_SCANS))
    run = timed(slam, log, len(log))
    grid, drawing = _drawn(slam)
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(truth[:, :2], axis=0).T))])
    seen = float(np.isfinite(grid.p).sum()) * grid.resolution**2
    return {
        "algorithm": label,
        "scans": len(log),
        "way_m": float(driven[-1]),
        "early_ms": _mean_ms(run.seconds, driven, min(EARLY, 0.5 * float(driven[-1]))),
        "late_ms": _mean_ms(run.seconds, driven, float(driven[-1])),
        "p99_ms": 1e3 * float(np.percentile(run.seconds, 99)),
        "longest_ms": 1e3 * float(run.seconds.max()),
        "longest_at_m": float(driven[int(run.seconds.argmax())]),
        "memory_mb": float(run.resident.max()),
        "seen_m2": seen,
        "map_ms": 1e3 * drawing,
        "ate_m": ate(run.poses, truth),
        "report": slam.report(),
    }


def timed(slam: Slam, scans: Iterable[Scan], n: int) -> Timed:
    """Update with `n` scans, compilation taken out of the times."""
    from slams.jit import CompileClock

    seconds, poses = np.zeros(n), np.zeros((n, 3))
    resident = np.zeros(-(-n // SAMPLE))
    gc.collect()
    gc.freeze()  # as a replay does: what was loaded before is no garbage
    start = resident_mb()
    with CompileClock() as compiling:
        for k, scan in enumerate(scans):
            compiled, begun = compiling.seconds, time.process_time()
            pose = slam.update(scan)
            seconds[k] = time.process_time() - begun - (compiling.seconds - compiled)
            poses[k] = pose
            if k % SAMPLE == 0:
                resident[k // SAMPLE] = resident_mb() - start
    gc.unfreeze()
    return Timed(np.maximum(seconds, 0.0), poses, resident)


def _warm(label: str, scans: Iterable[Scan]) -> Slam:
    """The algorithm, its kernels loaded."""
    entry = find(label)
    params = entry.params()
    warm_up(entry.cls, params, scans)
    return entry.cls(params)


def _drawn(slam: Slam) -> tuple[OccupancyGrid, float]:
    """The map, and the CPU time [s] to draw it; the first drawing may compile."""
    slam.map()
    begun = time.process_time()
    grid = slam.map()
    return grid, time.process_time() - begun


def _mean_ms(seconds: Floats, driven: Floats, end: float) -> float:
    """Mean time per scan over the stretch that ends at `end` [m]."""
    part = (driven > end - STRETCH) & (driven <= end)
    return 1e3 * float(seconds[part].mean())
