"""The lasers of a scan log: how its file keeps them, and which of them fell silent."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slams.params import MAX_LASERS
from slams.types import Floats, Laser, Pose2, Ranges
from slams.validation import MOST_BEAMS, expect

COLUMNS = (
    *("n_beams", "angle_min", "angle_increment", "range_min", "range_max", "time_increment"),
    *("mount.x", "mount.y", "mount.theta", "mount_z", "height"),
)
FORMAT, OF_SEVERAL = "scanlog-1", "scanlog-2"
REQUIRED = ("t", "ranges", "angle_min", "angle_increment", "range_min", "range_max")
HEIGHTS = ("mount_z", "height")
OF_LASER = (*REQUIRED[2:], "time_increment", "mount")
MAX_SILENCE = 3.0  # s without a scan at the end of a log, and usual intervals: a laser that died
MIN_SILENT_INTERVALS = 10.0


def to_table(lasers: Sequence[Laser]) -> Floats:
    """A row of `COLUMNS` for each laser; height is nan where it is not known."""
    return np.array([attrgetter(*COLUMNS)(laser) for laser in lasers], np.float64)


def from_table(table: Floats) -> tuple[Laser, ...]:
    """The lasers of a table (k, 11).

    Raises:
        ValueError: it is no such table.
    """
    shape = f"(k, {len(COLUMNS)}) with 1 <= k <= {MAX_LASERS}"
    fits = table.shape[1:] == (len(COLUMNS),) and 1 <= len(table) <= MAX_LASERS
    expect(fits, "lasers", table.shape, shape)
    return tuple(_laser(dict(zip(COLUMNS, row, strict=True))) for row in table.tolist())


def _laser(row: dict[str, float]) -> Laser:
    n, height = row.pop("n_beams"), row.pop("height")
    expect(n == n // 1 and 1 <= n <= MOST_BEAMS, "lasers", f"{n} beams", "a number of beams")
    mount = Pose2(*(row.pop(f"mount.{name}") for name in Pose2._fields))
    known = None if height != height else height
    return Laser(n_beams=int(n), mount=mount, height=known, **row)


def silent_lasers(t: Floats, laser_of: NDArray[np.int64], count: int) -> list[dict[str, float]]:
    """Lasers without a scan at the end of a log, and after how many seconds they fell silent.

    Args:
        t: stamps (n,) [s].
        laser_of: the number of its laser for each scan (n,).
        count: of lasers.
    """
    found = list[dict[str, float]]()
    for number in range(count):
        own = t[laser_of == number]
        last = float(own.max()) if len(own) else float(t.min())
        usual = float(np.median(np.diff(own))) if len(own) > 1 else 0.0
        if t.max() - last > max(MAX_SILENCE, MIN_SILENT_INTERVALS * usual):
            found.append({"laser": number, "last_s": last - float(t.min())})
    return found


def lasers(data: dict[str, Any], n_beams: int, version: str) -> dict[str, Any]:
    """Fields of a log about its lasers, from the arrays of its file."""
    if version == FORMAT:
        mount = numbers(data, "mount", 1) if "mount" in data else np.zeros(3)
        expect(mount.shape == (3,), "mount", mount.shape, "(3,)")
        keys = (*REQUIRED[2:], "time_increment", *HEIGHTS)
        known = {key: float(numbers(data, key, 0)) for key in keys if key in data}
        return {"laser": Laser(n_beams=n_beams, mount=Pose2(*mount.tolist()), **known)}
    laser, *others = from_table(numbers(data, "lasers", 2))
    rows = numbers(data, "laser", 1)
    with np.errstate(invalid="ignore"):
        whole = rows.astype(np.int64)
    expect(bool((whole == rows).all()), "laser", "broken numbers", "rows of `lasers`")
    return {"laser": laser, "others": tuple(others), "laser_of": whole}


def numbers(data: dict[str, Any], key: str, ndim: int) -> Floats:
    """An array of numbers of so many dimensions as float64; ValueError if it is none."""
    array = np.asarray(data[key])
    expect(array.dtype.kind in "fiu", key, f"{array.dtype} values", "numbers")
    expect(array.ndim == ndim, key, f"{array.ndim} dimensions", f"{ndim}")
    return np.array(array, np.float64, order="C")


def single(ranges: ArrayLike) -> Ranges:
    """Ranges as float32; what is too great for it is beyond every laser.

    Raises:
        ValueError: they are no numbers.
    """
    array = np.asarray(ranges)
    expect(array.dtype.kind in "fiu", "ranges", f"{array.dtype} values", "numbers")
    with np.errstate(over="ignore"):
        return array.astype(np.float32, copy=False)


def rep117(ranges: Ranges, laser: Laser) -> Ranges:
    """Read-only ranges: beyond range_max is inf, below range_min (or -inf) is nan."""
    clean = np.array(single(ranges), order="C")
    clean[clean >= laser.range_max] = np.inf
    clean[clean < laser.range_min] = np.nan
    clean.flags.writeable = False
    return clean
