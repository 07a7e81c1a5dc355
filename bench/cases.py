"""Cases: which algorithm runs on which log, and what came of it. One case is one process' work."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench import metrics
from slams.params import Params
from slams.player import Run, replay, warm_up
from slams.registry import find
from slams.scanlog import ScanLog, load
from slams.summary import moments, summarize
from slams.types import Floats, OccupancyGrid, Slam

WARM_UP_SCANS = 4


@dataclass(frozen=True)
class Choice:
    """Which part of a log is used, and the seed of every algorithm."""

    limit: int | None = None
    every: int = 1
    odometry: bool = True
    seed: int | None = None

    def log(self, path: str | Path) -> ScanLog:
        """The chosen part of the log at `path`."""
        return load(path).select(self.limit, self.every, self.odometry)


@dataclass(frozen=True)
class Outcome:
    """What came of one case; a failed one has only its row."""

    row: dict[str, Any]
    t: Floats
    poses: Floats
    grid: OccupancyGrid | None
    errors: metrics.UpdateErrors | None


def run_case(label: str, path: str, choice: Choice, relations: Floats | None = None) -> Outcome:
    """Replay the log at `path` through the algorithm `label`; what it raises ends in the row."""
    log = choice.log(path)
    try:
        return _outcome(label, log, choice, relations)
    except Exception as error:  # an outsider's algorithm may raise anything; the others go on
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        none = np.zeros(0)
        row = {"algorithm": label, "log": log.name, "failed": reason}
        return Outcome(row, none, none.reshape(0, 3), None, None)


def _outcome(label: str, log: ScanLog, choice: Choice, relations: Floats | None) -> Outcome:
    entry = find(label)
    params = _params(entry.params(), choice)
    start_up_s = warm_up(entry.cls, params, log.select(WARM_UP_SCANS))
    slam: Slam = entry.cls(params)
    run = replay(slam, log)
    row = summarize(run, log, label, params, start_up_s) | {"failed": None}
    errors = _against_truth(run, log)
    row["per_update"] = None if errors is None else _tables(errors)
    row["relations"] = None if relations is None else _relations(run, relations)
    return Outcome(row, run.t, run.poses, slam.map(), errors)


def _params(params: Params, choice: Choice) -> Params:
    return params if choice.seed is None else params.replace(seed=choice.seed)


def _against_truth(run: Run, log: ScanLog) -> metrics.UpdateErrors | None:
    truth = log.truth_at(run.t)
    if truth is None:
        return None
    errors = metrics.update_errors(run.t, run.poses, truth)
    return errors if len(errors.t) else None


def _tables(errors: metrics.UpdateErrors) -> dict[str, Any]:
    """[Kuehn] Tables I and II, and the SE(2) relative error beside them."""
    return {
        "updates": len(errors.t),
        "dropped": errors.dropped,
        "translation_m": moments(errors.translation),
        "orientation_rad": moments(errors.orientation),
        "se2_translation_m": moments(errors.se2_translation),
        "se2_rotation_rad": moments(errors.se2_rotation),
    }


def _relations(run: Run, relations: Floats) -> dict[str, Any]:
    translation, rotation, used = metrics.relation_errors(run.t, run.poses, relations)
    result: dict[str, Any] = {"used": used, "given": len(relations)}
    if used:
        result |= {"translation_m": moments(translation), "rotation_rad": moments(rotation)}
    return result


def read_relations(path: str | Path) -> Floats:
    """Rows t1 t2 x y theta (k, 5) of a Freiburg relations file (t1 t2 x y z roll pitch yaw).

    Raises:
        OSError: the file cannot be read.
        ValueError: it has other columns.
    """
    try:
        table = np.loadtxt(path, ndmin=2)
    except ValueError as error:
        raise ValueError(f"{path}: not a relations file ({error})") from error
    if table.shape[1] != 8:
        raise ValueError(
            f"{path}: got {table.shape[1]} columns, expected t1 t2 x y z roll pitch yaw"
        )
    rows: Floats = table[:, [0, 1, 2, 3, 7]]
    return rows


def write_results(path: Path, results: dict[str, Any]) -> None:
    """Write results.json, the single source of every table."""
    from slams.summary import as_json

    path.write_text(as_json(results), encoding="utf-8")


def read_results(path: str | Path) -> dict[str, Any]:
    """Read a results.json."""
    return dict(json.loads(Path(path).read_text(encoding="utf-8")))
