"""Runs and logs as arrays: in arrays.npz beside the figures, or packed into one text with them."""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.results.runs import Line, Outcome, Reference, Row
from slams.types import OccupancyGrid, Pose2


def arrays_of_outcome(outcome: Outcome) -> dict[str, Any]:
    """Everything of a run but its row."""
    arrays: dict[str, Any] = {
        "t": outcome.t,
        "poses": outcome.poses,
        "seconds": outcome.seconds,
        "frame": np.array(outcome.frame),
        **_arrays_of_grid(outcome.grid),
    }
    if outcome.common is not None:
        arrays |= {f"common_{key}": value for key, value in outcome.common._asdict().items()}
    return arrays


def outcome_of(row: Row, arrays: dict[str, Any]) -> Outcome:
    """The run of `arrays_of_outcome`."""
    from bench.judge.metrics import Common

    common = None
    if "common_t" in arrays:
        t, estimate, truth = (arrays[f"common_{key}"] for key in ("t", "estimate", "truth"))
        common = Common(t, estimate, truth, int(arrays["common_dropped"]))
    frame = Pose2(*arrays["frame"].tolist())
    series = arrays["t"], arrays["poses"], arrays["seconds"]
    return Outcome(row, *series, _grid(arrays), common, frame)


def arrays_of_reference(reference: Reference) -> dict[str, Any]:
    """Everything known of a log but its figures."""
    arrays = _arrays_of_grid(reference.grid)
    if reference.path is not None:
        arrays["path"] = reference.path
    if reference.start is not None:
        arrays["start"] = np.array(reference.start)
    return arrays


def reference_of(entry: Line, arrays: dict[str, Any]) -> Reference:
    """The log of `arrays_of_reference`."""
    start = Pose2(*arrays["start"].tolist()) if "start" in arrays else None
    return Reference(entry, arrays.get("path"), _grid(arrays), start)


def _arrays_of_grid(grid: OccupancyGrid | None) -> dict[str, Any]:
    if grid is None:
        return {}
    return {"grid": grid.p, "grid_place": np.array([grid.resolution, *grid.origin])}


def _grid(arrays: dict[str, Any]) -> OccupancyGrid | None:
    if "grid" not in arrays:
        return None
    resolution, x, y = arrays["grid_place"].tolist()
    return OccupancyGrid(arrays["grid"], resolution, (x, y))
