"""Go on in another run: with which parameters, and which scans of the log are left."""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from slams.state.store import State, read_state, save, state_of

if TYPE_CHECKING:
    from slams.params import Params
    from slams.registry import Entry
    from slams.scanlog import ScanLog
    from slams.types import Ranges, Slam


def resume(path: str | Path, entry: Entry, params: Params) -> State:
    """The state in a file, for a run that asked for an algorithm and parameters.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is no such state, or the run asked for other parameters than it has.
    """
    state = read_state(path, entry.label)
    saved: Params = getattr(state.slam, "params", params)
    if params not in (entry.params(), saved):
        names = [field.name for field in dataclasses.fields(saved)]
        name = next(n for n in names if getattr(saved, n) != getattr(params, n))
        raise ValueError(
            f"{path}: saved with {name} {getattr(saved, name)}, got {getattr(params, name)}; "
            "a state goes on with its own parameters, leave them away"
        )
    return state


def check_target(path: str | Path, slam: Slam) -> None:
    """Refuse, before any work is done, what cannot be saved, or not there.

    Raises:
        OSError: there is no such folder, or the path is one.
        TypeError: the algorithm keeps something that a state cannot hold.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path.parent}: no such folder to save a state in")
    if path.is_dir():
        raise IsADirectoryError(f"{path}: is a folder; expected a file to save the state in")
    state_of(slam, {})


def save_after(slam: Slam, path: str | Path, t: float, ranges: Ranges, **beside: Any) -> None:
    """Save an algorithm with its last scan, by stamp [s] and ranges (n,) [m], and what is `beside`.

    Raises:
        OSError, TypeError: as `save`.
    """
    save(slam, path, {"t": t, "scan": _digest(ranges)} | beside)


def rest_of(log: ScanLog, beside: dict[str, Any], every: int = 1) -> tuple[ScanLog, int]:
    """What of a log comes after the last scan of a state, and how many scans do not.

    A log that has no such scan, by stamp and ranges, is another drive: all of it is left. `every`
    is the step from one scan to the next.

    Raises:
        ValueError: nothing is left.
    """
    same = np.flatnonzero(log.t == beside.get("t"))
    known = [int(i) for i in same if _digest(log.ranges[i]) == beside.get("scan")]
    if not known:
        return log, 0
    first = known[-1] + every
    if first >= len(log):
        raise ValueError(f"{log.name}: all its {len(log)} scans are in the state already")
    return log.from_scan(first), first


def _digest(ranges: Ranges) -> str:
    return hashlib.sha256(np.ascontiguousarray(ranges).tobytes()).hexdigest()
