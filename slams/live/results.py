"""What a live run leaves behind: map, trajectory and what happened."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from slams.live.node import Drive, Node
from slams.params import Params
from slams.run import write_drive


def write_results(folder: Path, label: str, params: Params, node: Node) -> None:
    """Write all files, whole or not at all.

    Raises:
        OSError: they cannot be written.
    """
    drive = node.drive
    summary = {
        "algorithm": label,
        "params": params.as_dict(),
        "delay_ms": delays(drive),
        "node": node.report(),
    }
    t, poses = np.array(drive.t), np.array(drive.poses, np.float64).reshape(-1, 3)
    write_drive(folder, node.live.map(), (t, poses, node.live.corrected()), summary)


def delays(drive: Drive) -> dict[str, Any]:
    """From a scan's coming to its pose going out [ms]: median, 99 % and longest."""
    if not drive.delays:
        return {}
    p50, p99, most = 1e3 * np.percentile(drive.delays, (50, 99, 100))
    return {"p50": round(p50, 3), "p99": round(p99, 3), "max": round(most, 3)}
