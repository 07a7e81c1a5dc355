"""What is known of a log besides its scans: facts, true path, true map."""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.judge import mapquality, metrics
from bench.results import Reference
from slams.scanlog import ScanLog
from slams.types import Pose2


def reference(log: ScanLog) -> Reference:
    """Everything known of a log."""
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
    """The log's own figures."""
    entry: dict[str, Any] = {
        "name": log.name,
        "scans": len(log),
        "beams": log.laser.n_beams,
        "duration_s": float(log.t.max() - log.t.min()),
        "stamps_back": log.stamp_jumps,
        "odometry": log.odom is not None,
        "gyro": log.yaw_rate is not None,
        "truth_gap_s": None,
        "notes": list(log.notes),
        "meta": log.meta,
    }
    if len(log) == 1:
        entry["notes"].append("one scan only: there is no motion to compare")
    if log.truth is not None:
        stamps, _ = log.truth.in_order
        entry["truth_gap_s"] = float(np.diff(stamps).max()) if len(stamps) > 1 else None
        covered = int(np.isfinite(log.truth.poses_at(log.t)[:, 0]).sum())
        if covered < len(log):
            entry["notes"].append(
                f"the truth covers {covered} of {len(log)} scans; the others do not count"
            )
    return entry
