"""A climb: one algorithm over one log, degraded level by level until the run is lost.

A sweep consists of climbs; each run at one level is a trial.
"""

from __future__ import annotations

import gc
import hashlib
import json
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.judge import metrics
from bench.judge.loss import alarms, beyond
from bench.results.sweep import Cost, Trial
from bench.run.cases import sources
from bench.run.pool import sentence
from bench.run.store import canonical
from bench.run.work import MACHINE_ERRORS, Result
from slams.metrics import ate

if TYPE_CHECKING:
    from slams.params import Params
    from slams.player import Run
    from slams.registry import Entry
    from slams.scanlog import ScanLog

CLIMB_FUNCTION = "bench.run.trial:perform"


def content_of(log: ScanLog) -> str:
    """Hash of all content of a log that can affect a result."""
    found = hashlib.sha256(repr(log.laser).encode())
    for values in (log.t, log.ranges):
        found.update(np.ascontiguousarray(values).tobytes())
    for track in (log.odom, log.truth, log.yaw_rate, log.attitude):
        if track is not None:
            found.update(track.t.tobytes() + np.ascontiguousarray(track.values).tobytes())
        found.update(b"|")
    return found.hexdigest()


def perform(
    log: dict[str, Any],
    condition: dict[str, Any],
    algorithm: str,
    parameters: dict[str, Any],
    odometry: bool,
    recorded: str | None,
) -> Result:
    """Climb: {"trials": one for each level up to the first lost one}, and their costs."""
    from slams.registry import find

    entry = find(algorithm)
    params = entry.params().replace(**parameters)
    trials: list[Trial] = []
    costs: list[Cost | None] = []
    for level in condition["levels"]:
        try:
            degraded = _log_of(canonical(log), canonical(condition), level, recorded)
            trial, cost = _run(entry, params, degraded, odometry)
        except MACHINE_ERRORS:
            raise
        except (Exception, SystemExit) as error:  # an external algorithm may raise anything
            trial, cost = {"failed": sentence(error)}, None
        trials.append(trial)
        costs.append(cost)
        if trial["failed"] or trial["lost"]:
            break
    return Result({"trials": trials}, {"costs": costs})


def _run(entry: Entry, params: Params, log: ScanLog, odometry: bool) -> tuple[Trial, Cost]:
    from slams.player import WARM_UP_SCANS, replay, warm_up

    given = log.select(odometry=odometry)
    warm_up(entry.cls, params, given.select(WARM_UP_SCANS))
    _freeze_kernels(entry.label)
    run = replay(entry.cls(params), given)
    return judged(run, log), {"cpu_s": float(run.seconds.sum())}


@cache
def _freeze_kernels(label: str) -> None:
    """Exclude loaded kernels from garbage collection, which takes half of a short run's time."""
    gc.collect()
    gc.freeze()


def judged(run: Run, log: ScanLog) -> Trial:
    """The figures of a run by the log's ground truth; ValueError without one."""
    common = metrics.common_with(log, run.t, run.poses)
    if common is None:
        raise ValueError(f"{log.name}: fewer than two scans have ground truth")
    row = sources(run.report, len(run))
    off = beyond(common)
    covered = ~np.isnan(log.truth_at(run.t)[:, 0])  # type: ignore[index]
    reports = alarms(run.says_lost[covered], common.t, off)
    second = metrics.errors_over_spans(common).get("1 s")
    return {
        "failed": None,
        "used": row["used"] or [],
        "scans": len(run),
        "duration_s": float(run.t.max() - run.t.min()),
        "ate_m": ate(common.estimate, common.truth),
        "second_m": None if second is None else float(second.se2_translation.mean()),
        "lost": bool(off.any()),
        "right_again": reports.right_again,
        "episodes": reports.episodes,
        "said_in_time": reports.in_time,
        "right_scans": reports.right,
        "false_alarms": reports.false,
        "wheels_ate_m": _wheels_ate(log),
    }


def _wheels_ate(log: ScanLog) -> float | None:
    """Absolute error of the odometry alone [m], over the scans with odometry."""
    wheels = log.odometry_at_scans()
    if wheels is None:
        return None
    known = np.isfinite(wheels[:, 0])
    found = metrics.common_with(log, log.t[known], wheels[known])
    return None if found is None else ate(found.estimate, found.truth)


@lru_cache(maxsize=1)
def _loaded(identity: str, recorded: str | None) -> ScanLog:
    """A log of the plan by its identity (JSON): simulated, or read from the path `recorded`."""
    from bench.sim.setting import Setting
    from bench.sim.simulation import simulate
    from slams.scanlog import load_npz

    known = json.loads(identity)
    if "setting" in known:
        return simulate(Setting(**known["setting"]))
    if recorded is None:
        raise ValueError("a recorded log without its path on this machine")
    log = load_npz(Path(recorded))
    if content_of(log) != known["content"]:
        raise OSError(f"{recorded}: has changed since the sweep began; start again")
    return log


@lru_cache(maxsize=10)  # levels of a climb; the next algorithm uses the same logs
def _log_of(identity: str, condition: str, level: float, recorded: str | None) -> ScanLog:
    """The log at a level of a condition (JSON), reduced to its scan rate.

    Noise of the stamps does not change the period of a log with the same scans.
    """
    from bench.sim.degrade import degrade

    known, whole = json.loads(condition), _loaded(identity, recorded)
    log = degrade(whole, known["degradation"], level, known["seed"])
    period = (whole if len(log) == len(whole) else log).scan_period
    if known["rate"] is None or period <= 0.0:
        return log
    return log.select(every=max(1, round(1.0 / (known["rate"] * period))))
