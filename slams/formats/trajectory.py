"""Trajectories: csv (t,x,y,theta) and the TUM format that evo and others read."""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path

import numpy as np

from slams.types import Floats

GZIP = b"\x1f\x8b"
BOM = b"\xef\xbb\xbf"  # that spreadsheets put before a csv


def write_csv(path: str | Path, t: Floats, poses: Floats) -> None:
    """Write `t,x,y,theta` lines [s, m, m, rad] with a header; poses (n, 3)."""
    table = np.column_stack([t, poses])
    header = "t,x,y,theta"
    np.savetxt(
        path, table, fmt=["%.6f", "%.9f", "%.9f", "%.9f"], delimiter=",", header=header, comments=""
    )


def write_tum(path: str | Path, t: Floats, poses: Floats) -> None:
    """Write `t x y z qx qy qz qw` lines; poses (n, 3) lie in the plane z = 0."""
    zero, half = np.zeros(len(t)), 0.5 * poses[:, 2]
    table = np.column_stack(
        [t, poses[:, 0], poses[:, 1], zero, zero, zero, np.sin(half), np.cos(half)]
    )
    np.savetxt(path, table, fmt="%.9f", header="t x y z qx qy qz qw")


def read_tum(path: str | Path) -> tuple[Floats, Floats]:
    """Read `t x y z qx qy qz qw` lines: t (n,) and the poses (n, 3) in the plane.

    Raises:
        OSError: the file cannot be opened.
        ValueError: the file has other columns.
    """
    table = _table(path, None, "t x y z qx qy qz qw", 8)
    x, y, z, w = table[:, 4:].T
    with np.errstate(over="ignore", invalid="ignore"):  # no rotation; `read` finds the nan
        yaw = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return table[:, 0], np.column_stack([table[:, 1:3], yaw])


def read(path: str | Path) -> tuple[Floats, Floats]:
    """A trajectory file of either kind: t (n,) and poses (n, 3), all finite.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is neither; the sentence says what was found.
    """
    first = next(iter(_lines(path)), "")
    t, poses = (read_csv if "," in first else read_tum)(path)
    if not len(t) or not (np.isfinite(t).all() and np.isfinite(poses).all()):
        raise ValueError(f"{path}: got no poses or such that are not finite, expected a trajectory")
    return t, poses


def read_csv(path: str | Path) -> tuple[Floats, Floats]:
    """Read what `write_csv` wrote: t (n,) and poses (n, 3).

    Raises:
        ValueError: the file has other columns.
    """
    table = _table(path, ",", "t,x,y,theta", 4)
    return table[:, 0], table[:, 1:]


def _table(path: str | Path, delimiter: str | None, columns: str, n: int) -> Floats:
    """The numbers of a file (k, n)."""
    rows = [line.split(delimiter) for line in _lines(path)]
    wrong = next((row for row in rows if len(row) != n), None)
    if wrong is not None:
        raise ValueError(f"{path}: got {len(wrong)} columns, expected {columns}")
    try:
        return np.array(rows, np.float64).reshape(-1, n)
    except ValueError as error:
        raise ValueError(f"{path}: not lines of {columns} ({error})") from error


def _lines(path: str | Path) -> list[str]:
    """All lines but the empty ones and those that begin with # or t: comments and column names."""
    data = Path(path).read_bytes()
    if data.startswith(GZIP):
        try:
            data = gzip.decompress(data)
        except (OSError, EOFError, zlib.error) as error:
            raise ValueError(f"{path}: damaged or cut short ({error}); copy it again") from error
    text = data.removeprefix(BOM).decode("latin-1")
    return [line for line in text.split("\n") if line.strip()[:1] not in "#t"]
