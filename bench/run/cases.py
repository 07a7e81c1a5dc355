"""Cases: one algorithm on one log, and its outcome. Each case runs in its own process."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np

import slams.jit  # noqa: F401 loads numba before the memory is measured
from bench.judge import loss, mapquality, metrics
from bench.results import Errors, Outcome, Reference, Row
from bench.run.single import algorithm_of
from bench.run.timing import PeakMemory
from slams import load
from slams.formats.options import SourceOptions
from slams.metrics import ate, path_length
from slams.params import Params
from slams.player import WARM_UP_SCANS, replay, warm_up
from slams.registry import find
from slams.ros.ros_params import Taken
from slams.scanlog import ScanLog
from slams.summary import cost, moments, summarize
from slams.types import Floats, Pose2, Scan, Slam


@dataclass(frozen=True)
class Choice:
    """Which part of a log is used and how, and the seed of a simulated log.

    `options` for reading a recorded log. By label: `params` of algorithms that differ from their
    presets, and `ros`, the parameters from ROS files. `relations` (k, 5) for the evaluation;
    `starts` is the number of start scans, `duration` [s] the used part of a log.
    """

    limit: int | None = None
    every: int = 1
    odometry: bool = True
    seed: int = 0
    options: SourceOptions | None = None
    params: Mapping[str, Params] = field(default_factory=dict)
    ros: Mapping[str, Taken] = field(default_factory=dict)
    relations: Floats | None = None
    starts: int = 1
    duration: float | None = None

    def log(self, path: str | Path) -> ScanLog:
        """The chosen part of the log at `path`."""
        return self.part(load(path, self.options).of_one_laser())

    def part(self, log: ScanLog) -> ScanLog:
        """The chosen part of a log."""
        if self.duration is not None:
            log = log.rows(log.t < log.t[0] + self.duration)
        return log.select(self.limit, self.every, self.odometry)


def reference(log: ScanLog) -> Reference:
    """The ground truth and the figures of a log."""
    entry = facts(log)
    truth = log.truth_at(log.t)
    if truth is None:
        return Reference(entry)
    found = metrics.common(log.t, truth, truth)
    if not len(found.t):
        return Reference(entry)
    at_first = Pose2(*truth[0].tolist()) if np.isfinite(truth[0]).all() else None
    true_map = mapquality.truth_map(log)
    return Reference(entry, found.truth, true_map, at_first)


def facts(log: ScanLog) -> dict[str, Any]:
    """The figures of a log."""
    entry: dict[str, Any] = {
        "name": log.name,
        "scans": len(log),
        "beams": log.laser.n_beams,
        "duration_s": float(log.t.max() - log.t.min()),
        "stamps_back": log.stamp_jumps,
        "odometry": log.odom is not None,
        "gyro": log.yaw_rate is not None,
        "notes": list(log.notes),
        "meta": log.meta,
    }
    if len(log) == 1:
        entry["notes"].append("one scan only: there is no motion to compare")
    if log.truth is not None:
        covered = int(np.isfinite(log.truth.known_poses_at(log.t)[:, 0]).sum())
        if covered < len(log):
            entry["notes"].append(
                f"the truth covers {covered} of {len(log)} scans; the others do not count"
            )
    return entry


def replayed(label: str, log: ScanLog, choice: Choice) -> Outcome:
    """Replay a log through the algorithm `label`; its exceptions propagate."""
    entry = find(algorithm_of(label))
    params = choice.params.get(label) or entry.params()
    with PeakMemory() as memory:
        start_up_s = warm_up(entry.cls, params, log.select(WARM_UP_SCANS))
        slam: Slam = entry.cls(params)
        quality: list[float] = []
        run = replay(slam, _watched(log, slam, quality))
        grid = slam.map()
    summary = summarize(run, log, label, params, start_up_s)
    row = cast("Row", summary) | sources(run.report, len(run))
    row["cost"] = cost(run.seconds, row["duration_s"]) | {
        "start_up_s": summary["compile_s"],
        "peak_memory_mb": memory.mb,
    }
    row["conflict"] = 1.0 - float(np.mean(quality)) if quality else None
    row |= judged(log, run.t, run.final, choice.relations, run.report)
    common = metrics.common_with(log, run.t, run.final)
    return Outcome(row, run.t, run.final, grid, common)


def _watched(log: ScanLog, slam: Slam, quality: list[float]) -> Iterator[Scan]:
    """The scans; appends the match quality of each to `quality`, if the algorithm has it."""
    for scan in log:
        yield scan
        if hasattr(slam, "quality"):
            quality.append(slam.quality)


def failed(label: str, log: ScanLog, reason: str) -> Outcome:
    """The outcome of a failed run: only its reason."""
    return Outcome({"algorithm": label, "log": log.name, "failed": reason})


def relation_error(outcome: Outcome) -> float | None:
    """Mean error of the relations [m]; None for failed and lost runs."""
    row = outcome.row
    known = None if row["failed"] else (row["relations"] or {}).get("all")
    if known is None or row["loss"]["lost"]:
        return None
    return float(known["translation_m"]["mean"])


def sources(report: dict[str, Any], scans: int) -> Row:
    """The sensors behind the poses, and the shares of matched and refined scans, by the report."""
    wheels, gyro = report.get("odometry", 0), report.get("gyro", 0)
    blind = report.get("laser", scans) == 0  # a baseline without the ranges
    used = [n for n, count in (("laser", not blind), ("wheels", wheels), ("gyro", gyro)) if count]
    shares = {key: report[key] / scans if key in report else None for key in ("posed", "refined")}
    return {"failed": None, "used": used, "posed": shares["posed"], "refined": shares["refined"]}


def judged(
    log: ScanLog, t: Floats, poses: Floats, relations: Floats | None, report: dict[str, Any]
) -> Row:
    """Errors of poses against the log's ground truth and the relations, if they exist."""
    common = metrics.common_with(log, t, poses)
    found = None if relations is None else metrics.relation_errors(t, poses, relations)
    return {
        "errors": None if common is None else _against_truth(common),
        "relations": None if found is None else _relations(found),
        "loss": _losses(common, found, t, report),
    }


def _against_truth(common: metrics.Common) -> Errors:
    """[Kuehn] Tables I and II over each span; ATE and drift."""
    length = path_length(common.truth)
    end = float(math.hypot(*(common.estimate[-1, :2] - common.truth[-1, :2])))
    spans = metrics.errors_over_spans(common)
    return {
        "dropped": common.dropped,
        "spans": {name: _moments(found) for name, found in spans.items()},
        "ate_m": ate(common.estimate, common.truth),
        "end_m": end,
        "drift": end / length if length > 0.0 else None,
    }


def _moments(errors: metrics.SpanErrors) -> dict[str, Any]:
    named = {
        "translation_m": errors.translation,
        "orientation_rad": errors.orientation,
        "se2_translation_m": errors.se2_translation,
    }
    return {"n": len(errors.t)} | {key: moments(values) for key, values in named.items()}


def _relations(found: metrics.RelationErrors) -> dict[str, Any]:
    """[Kuemmerle09]: absolute errors of all relations, of local ones and of loops."""
    result: dict[str, Any] = {"used": len(found.t), "given": found.given}
    parts = {"all": np.ones(len(found.t), bool), "local": ~found.loop, "loop": found.loop}
    for name, part in parts.items():
        if part.any():
            errors = {"translation_m": found.translation, "rotation_rad": found.rotation}
            figures = {key: moments(values[part]) for key, values in errors.items()}
            result[name] = {"used": int(part.sum())} | figures
    return result


def _losses(
    common: metrics.Common | None,
    found: metrics.RelationErrors | None,
    t: Floats,
    report: dict[str, Any],
) -> dict[str, Any]:
    """Whether the run was lost: by each criterion, and by the most reliable one."""
    verdicts: dict[str, Any] = {"report": loss.by_report(report, len(t))}
    if found is not None and len(found.t):
        verdicts["relations"] = loss.by_relations(found, float(t.min()))
    if common is not None:
        verdicts["truth"] = loss.by_truth(common)
    best = next(name for name in ("truth", "relations", "report") if name in verdicts)
    return verdicts | {"lost": verdicts[best]["lost"], "by": best}


def read_relations(path: str | Path) -> Floats:
    """Rows t1 t2 x y theta (k, 5) of a Freiburg relations file (t1 t2 x y z roll pitch yaw).

    Raises:
        OSError: the file cannot be read.
        ValueError: it has no relation, other columns, or invalid numbers.
    """
    text = Path(path).read_text(encoding="utf-8", errors="replace")
    rows = [line.split() for line in text.splitlines() if line.strip()]
    if {len(row) for row in rows} != {8}:
        raise ValueError(f"{path}: expected relations, lines t1 t2 x y z roll pitch yaw")
    try:
        table = np.array(rows, dtype=np.float64)
    except ValueError as error:
        raise ValueError(f"{path}: not a relations file ({error})") from error
    if not np.isfinite(table).all():
        raise ValueError(f"{path}: got numbers that are not finite, expected seconds and meters")
    chosen: Floats = table[:, [0, 1, 2, 3, 7]]
    return chosen
