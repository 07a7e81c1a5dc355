"""Loads a recorded file of any kind as a ScanLog: detects the kind and calls its reader."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from slams.formats import carmen, recording, trajectory
from slams.formats.kind import BAG_KINDS, kind_of
from slams.formats.options import SourceOptions, name_in_errors
from slams.scanlog import ScanLog, load_npz
from slams.validation import expect

KIND_TITLES = {"npz": "an npz file", "carmen": "a CARMEN log"}
UNUSED_OPTIONS = {  # options without an effect, by kind
    "npz": ("scan_topic", "odom", "imu", "base_frame", "salvage"),
    "carmen": ("imu", "base_frame"),
}
SLOW_SCAN_PERIOD, MAX_SCAN_PERIOD = 10.0, 1000.0  # s from scan to scan: noted, and refused
MIN_COVERED_SHARE = 0.9  # of the scans; a time series that covers fewer is noted


def load(
    path: str | Path | Sequence[str | Path],
    options: SourceOptions | None = None,
    **choices: Any,
) -> ScanLog:
    """Read a recorded log: scanlog npz, ROS bag or CARMEN log, by its content.

    Args:
        path: the file, or the folder of a ROS 2 bag; or the files of one recording in bags.
        options: choices of topics, frames and files that the log leaves open.
        choices: single options, as `scan_topic="/scan"`.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it has no complete, valid log, or the options do not fit it; with the reason.
    """
    paths = [Path(path)] if isinstance(path, str | Path) else [Path(item) for item in path]
    expect(len(paths) > 0, "files", "no log given", "one, or the files of a split bag")
    is_new = len({path.resolve() for path in paths}) == len(paths)
    expect(is_new, "files", "a file twice", "the files of a split bag")
    options = replace(options or SourceOptions(), **choices)
    kinds = [kind_of(path) for path in paths]
    for item, its_kind in zip(paths, kinds, strict=True):
        if its_kind == "other":
            empty = "" if item.stat().st_size else "empty; "
            raise ValueError(f"{item}: {empty}not an npz file, a ROS bag or a CARMEN log")
        if len(paths) > 1 and its_kind not in BAG_KINDS:
            raise ValueError(f"{item}: is no bag; of several files only bags make one log")
    kind, one = kinds[0], f"one: {paths[0]} is no bag"
    expect(kind in BAG_KINDS or not options.more_scan_topics, "--scan-topic", "several", one)
    with name_in_errors(paths):
        log = _with_truth(paths, kind, options)
        slow = _slow_scans(log)
    return _with_notes(log, [*log.notes, *_unused_options(kind, options), *_uncovered(log), *slow])


def _with_truth(paths: list[Path], kind: str, options: SourceOptions) -> ScanLog:
    """The log, with the truth of a trajectory file if one is given; a bag can have its own."""
    wanted = options.truth
    if wanted is None or (kind in BAG_KINDS and not trajectory.is_file(wanted)):
        return _read(paths, kind, options)
    log = replace(_read(paths, kind, replace(options, truth="none")), truth=None)
    if wanted == "none":
        return log
    truth, source = trajectory.read_poses(Path(wanted), options.salvage), log.meta.get("source", {})
    if isinstance(source, dict):  # an npz of another program can have any type here
        source = source | {"truth": Path(wanted).name}
    return replace(log, truth=truth, meta=log.meta | {"source": source})


def _read(paths: list[Path], kind: str, options: SourceOptions) -> ScanLog:
    if kind in BAG_KINDS:
        return recording.read(paths, options, recording.Recording.log)
    if kind == "carmen":
        return carmen.read(paths[0], options)
    log = load_npz(paths[0])
    choices = {"odom": options.odom, "yaw_rate": options.imu}
    hidden: dict[str, Any] = {key: None for key, choice in choices.items() if choice == "none"}
    return replace(log, **hidden) if hidden else log


def _with_notes(log: ScanLog, notes: list[str]) -> ScanLog:
    """The log with its notes, in `meta` after the notes of an earlier conversion."""
    earlier = log.meta.get("notes")
    kept = [note for note in earlier if note not in notes] if isinstance(earlier, list) else []
    meta = log.meta | {"notes": [*kept, *notes]}
    return replace(log, notes=tuple(notes), meta=meta) if notes else log


def _unused_options(kind: str, options: SourceOptions) -> list[str]:
    """A note on given options that have no effect on this kind of log."""
    values = {name: getattr(options, name) for name in UNUSED_OPTIONS.get(kind, ())}
    names = [name for name, value in values.items() if value not in (None, False, "none")]
    flags = ", ".join(f"--{name.replace('_', '-')}" for name in names)
    return [f"{flags}: nothing to choose in {KIND_TITLES[kind]}"] if names else []


def _slow_scans(log: ScanLog) -> list[str]:
    """A note on stamps that are probably in another unit than seconds."""
    period = log.scan_period
    expect(period < MAX_SCAN_PERIOD, "t", f"a scan every {period:g} s", "seconds")
    if period < SLOW_SCAN_PERIOD:
        return []
    return [f"a scan every {period:g} s; milliseconds? the stamps of a log are seconds"]


def _uncovered(log: ScanLog) -> list[str]:
    """Notes on time series that do not cover the scans."""
    series = {"odometry": log.odom, "the truth": log.truth, "the yaw rate": log.yaw_rate}
    notes = []
    for name, one in series.items():
        if one is not None:
            inside = int(((log.t >= one.t.min()) & (log.t <= one.t.max())).sum())
            if one is log.truth:  # only there is a gap not bridged
                inside = int(np.isfinite(one.known_poses_at(log.t)[:, 0]).sum())
            if inside < MIN_COVERED_SHARE * len(log):
                notes.append(f"{name} covers {inside} of {len(log)} scans")
            if inside == 0:
                notes[-1] += f": {one.t.min():.3f} to {one.t.max():.3f} s, the scans "
                notes[-1] += f"{log.t.min():.3f} to {log.t.max():.3f} s"
    return notes
