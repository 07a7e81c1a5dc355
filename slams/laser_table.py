"""The lasers of a scan log: their arrays in its file, and lasers that stopped sending."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slams.params import MAX_LASERS
from slams.types import Floats, Laser, Pose2, Ranges
from slams.validation import MAX_BEAMS, expect

LASER_COLUMNS = (
    *("n_beams", "angle_min", "angle_increment", "range_min", "range_max", "time_increment"),
    *("mount.x", "mount.y", "mount.theta", "mount_z", "height"),
)
SCANLOG_1, SCANLOG_2 = "scanlog-1", "scanlog-2"
REQUIRED_KEYS = ("t", "ranges", "angle_min", "angle_increment", "range_min", "range_max")
HEIGHT_KEYS = ("mount_z", "height")
LASER_KEYS = (*REQUIRED_KEYS[2:], "time_increment", "mount")
MIN_OUTAGE = 3.0  # s without a scan at the end of a log, of a laser that failed
MIN_OUTAGE_INTERVALS = 10.0  # the same, as a number of its median scan intervals


def to_table(lasers: Sequence[Laser]) -> Floats:
    """A row of `LASER_COLUMNS` for each laser; an unknown height is nan."""
    return np.array([attrgetter(*LASER_COLUMNS)(laser) for laser in lasers], np.float64)


def from_table(table: Floats) -> tuple[Laser, ...]:
    """The lasers of a table (k, 11).

    Raises:
        ValueError: the table is invalid.
    """
    shape = f"(k, {len(LASER_COLUMNS)}) with 1 <= k <= {MAX_LASERS}"
    fits = table.shape[1:] == (len(LASER_COLUMNS),) and 1 <= len(table) <= MAX_LASERS
    expect(fits, "lasers", table.shape, shape)
    return tuple(_laser(dict(zip(LASER_COLUMNS, row, strict=True))) for row in table.tolist())


def _laser(row: dict[str, float]) -> Laser:
    n, height = row.pop("n_beams"), row.pop("height")
    expect(n == n // 1 and 1 <= n <= MAX_BEAMS, "lasers", f"{n} beams", "a number of beams")
    mount = Pose2(*(row.pop(f"mount.{name}") for name in Pose2._fields))
    known = None if height != height else height
    return Laser(n_beams=int(n), mount=mount, height=known, **row)


def silent_lasers(t: Floats, laser_of: NDArray[np.int64], count: int) -> list[dict[str, float]]:
    """Lasers without a scan at the end of a log, each with the time of its last scan [s].

    Args:
        t: stamps (n,) [s].
        laser_of: number of the laser of each scan (n,).
        count: number of lasers.
    """
    found = list[dict[str, float]]()
    for number in range(count):
        own = t[laser_of == number]
        last = float(own.max()) if len(own) else float(t.min())
        interval = float(np.median(np.diff(own))) if len(own) > 1 else 0.0
        if t.max() - last > max(MIN_OUTAGE, MIN_OUTAGE_INTERVALS * interval):
            found.append({"laser": number, "last_s": last - float(t.min())})
    return found


def laser_fields(data: dict[str, Any], n_beams: int, version: str) -> dict[str, Any]:
    """The fields of a `ScanLog` about its lasers, from the arrays of its file."""
    if version == SCANLOG_1:
        mount = number_array(data, "mount", 1) if "mount" in data else np.zeros(3)
        expect(mount.shape == (3,), "mount", mount.shape, "(3,)")
        keys = (*REQUIRED_KEYS[2:], "time_increment", *HEIGHT_KEYS)
        known = {key: float(number_array(data, key, 0)) for key in keys if key in data}
        return {"laser": Laser(n_beams=n_beams, mount=Pose2(*mount.tolist()), **known)}
    laser, *others = from_table(number_array(data, "lasers", 2))
    rows = number_array(data, "laser", 1)
    with np.errstate(invalid="ignore"):
        whole = rows.astype(np.int64)
    expect(bool((whole == rows).all()), "laser", "broken numbers", "rows of `lasers`")
    return {"laser": laser, "others": tuple(others), "laser_of": whole}


def number_array(data: dict[str, Any], key: str, ndim: int) -> Floats:
    """An array of numbers with `ndim` dimensions as float64, else ValueError."""
    array = np.asarray(data[key])
    expect(array.dtype.kind in "fiu", key, f"{array.dtype} values", "numbers")
    expect(array.ndim == ndim, key, f"{array.ndim} dimensions", f"{ndim}")
    return np.array(array, np.float64, order="C")


def as_float32(ranges: ArrayLike) -> Ranges:
    """Ranges as float32; values that overflow are inf.

    Raises:
        ValueError: the ranges are no numbers.
    """
    array = np.asarray(ranges)
    expect(array.dtype.kind in "fiu", "ranges", f"{array.dtype} values", "numbers")
    with np.errstate(over="ignore"):
        return array.astype(np.float32, copy=False)


def rep117(ranges: Ranges, laser: Laser) -> Ranges:
    """Read-only ranges by REP 117: from range_max on inf, below range_min (or -inf) nan."""
    clean = np.array(as_float32(ranges), order="C")
    clean[clean >= laser.range_max] = np.inf
    clean[clean < laser.range_min] = np.nan
    clean.flags.writeable = False
    return clean
