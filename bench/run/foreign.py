"""Other programs as rows of a comparison, by their trajectory and map."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bench.judge import loss, metrics
from bench.results import Outcome, Row
from bench.run.cases import judged
from bench.run.single import named
from slams.formats.occupancy import read_map
from slams.formats.trajectory import read_trajectory
from slams.metrics import between
from slams.types import Floats, OccupancyGrid, Pose2

if TYPE_CHECKING:
    from slams.formats.options import SourceOptions
    from slams.scanlog import ScanLog, TimeSeries


class Foreign(NamedTuple):
    """The run of another program on a log: poses in the frame of its map, and the map."""

    name: str
    track: TimeSeries
    grid: OccupancyGrid | None


def read_foreign(
    trajectories: Sequence[str],
    maps: Sequence[str],
    taken: Sequence[str],
    log_path: str | Path | None,
    options: SourceOptions | None,
) -> list[Foreign]:
    """Read the trajectories and maps of `--trajectory NAME=WHAT` and `--map NAME=FILE`.

    Args:
        trajectories: a file (TUM, result.mcap), or a topic or tf frame of the log's bag.
        maps: map_server yaml files.
        taken: names of existing rows.
        log_path: the log.
        options: for reading the log.

    Raises:
        ValueError: a name is missing or repeated, a map has no trajectory, or a file is not a
            trajectory or map.
        OSError: a file cannot be opened.
    """
    tracks, grids = _named("--trajectory", trajectories, "WHAT"), _named("--map", maps, "FILE")
    for name in tracks:
        if name in taken:
            raise ValueError(f"--trajectory: got {name!r}, the name of an existing row")
    for name in grids:
        if name not in tracks:
            raise ValueError(f"--map: got {name!r}, expected a name given to --trajectory as well")
    return [
        Foreign(
            name,
            read_trajectory(what, log_path, options),
            read_map(Path(grids[name])) if name in grids else None,
        )
        for name, what in tracks.items()
    ]


def foreign_case(foreign: Foreign, log: ScanLog, relations: Floats | None = None) -> Outcome:
    """The outcome of another program's run, without its CPU time.

    Poses keep their own stamps; those outside the log are left out. Ground truth and poses are
    interpolated, never extrapolated. A run that ends before the log is lost from its end.

    Raises:
        ValueError: fewer than two of its poses are within the log's time.
    """
    t, poses = _within(foreign, log)
    frame = _frame(t, poses, log)
    poses_at_first = between(np.repeat(np.array(frame)[None], len(poses), axis=0), poses)
    row: Row = {
        "algorithm": foreign.name,
        "log": log.name,
        "failed": None,
        "used": None,
        "posed": None,
        "refined": None,
        "scans": len(t),
        "duration_s": float(t[-1] - t[0]),
        "cost": None,
        "report": {},
        "parameters": {},
    }
    row |= judged(log, t, poses_at_first, None, {})
    if relations is not None:
        row |= _by_relations(foreign, log, relations, row)
    if not row["loss"]["lost"]:
        row["loss"] |= loss.by_end(t, log.t)
    common = metrics.common_with(log, t, poses_at_first)
    return Outcome(row, t, poses_at_first, grid=foreign.grid, common=common, frame=frame)


def _named(option: str, texts: Sequence[str], value: str) -> dict[str, str]:
    found: dict[str, str] = {}
    for text in texts:
        name, what = named(option, text, f"NAME={value}")
        if name in found:
            raise ValueError(f"{option}: got the name {name!r} twice, expected different ones")
        found[name] = what
    return found


def _within(foreign: Foreign, log: ScanLog) -> tuple[Floats, Floats]:
    """The poses within the log's time, extended by one scan period."""
    t, first, last = foreign.track.t, float(log.t.min()), float(log.t.max())
    margin = abs(log.scan_period)
    inside = (t >= first - margin) & (t <= last + margin)
    if inside.sum() < 2:
        raise ValueError(
            f"--trajectory {foreign.name}: {int(inside.sum())} of its {len(t)} poses are within "
            f"the log's time ({first:.3f} to {last:.3f} s; they are from {t.min():.3f} to "
            f"{t.max():.3f} s): is it another log's?"
        )
    return t[inside], foreign.track.values[inside]


def _frame(t: Floats, poses: Floats, log: ScanLog) -> Pose2:
    """The pose at the log's first scan in the map's frame, by the true motion in between.

    Without ground truth, the first pose of the program.
    """
    first = Pose2(*poses[0].tolist())
    truth = log.truth_at(np.array([log.t[0], t[0]]))
    if truth is None or not np.isfinite(truth).all():
        return first
    start, here = (Pose2(*pose.tolist()) for pose in truth)
    return first @ here.inverse() @ start


def _by_relations(foreign: Foreign, log: ScanLog, relations: Floats, row: Row) -> Row:
    """Errors of the relations, with poses interpolated at the stamps of the scans."""
    at_scans = foreign.track.known_poses_at(log.t)
    known = np.isfinite(at_scans[:, 0])
    found = judged(log, log.t[known], at_scans[known], relations, {})
    return {"relations": found["relations"], "loss": (row if row["errors"] else found)["loss"]}
