"""Lines of numbers that are poses: TUM files, and csv files by the names in their header.

The time is in seconds, lengths are in metres, angles in radians. The heading is a column of its
own or that of a quaternion.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from slams.formats.packed import GZIP, all_unpacked
from slams.types import Floats

BOM = b"\xef\xbb\xbf"  # that spreadsheets put before a csv
TUM = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
CSV = ("t", "x", "y", "theta")
ROTATION = ("qx", "qy", "qz", "qw")
OTHER_NAMES = {  # how others call them
    "time": "t",
    "timestamp": "t",
    "stamp": "t",
    "tx": "x",
    "ty": "y",
    "px": "x",
    "py": "y",
    "yaw": "theta",
    "heading": "theta",
}
VECTORS = {"position_": "", "translation_": "", "orientation_": "q", "rotation_": "q"}
UNIT = re.compile(r"\s*[\[(](s|m|rad)[\])]$|_(s|m|rad)$")
MIN_QUATERNION_NORM = 1e-6  # of a quaternion that is a rotation

Poses = tuple[Floats, Floats]  # t (n,), poses (n, 3)


def read(path: str | Path) -> Poses:
    """The poses of a file: csv if there are commas between its numbers, else TUM.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is neither, or a packed file that is not whole.
    """
    lines = lines_of(path)
    first = next((line for line in lines if line[:1] not in "#t"), "")
    return (csv if "," in first else tum)(path, lines)


def lines_of(path: str | Path) -> list[str]:
    """The lines of a text that are not empty, without the space around them."""
    data = Path(path).read_bytes()
    if data.startswith(GZIP):
        data, reason = all_unpacked(path, data)
        if reason:
            raise ValueError(f"{path}: damaged or cut short ({reason}); copy it again")
    lines = data.removeprefix(BOM).decode("latin-1").split("\n")
    return [line.strip() for line in lines if line.strip()]


def tum(path: str | Path, lines: Sequence[str]) -> Poses:
    """Poses of TUM lines; those that begin with # or t are comments and names of columns."""
    rows = [line.split() for line in lines if line[0] not in "#t"]
    return _poses(path, rows, TUM, " ")


def csv(path: str | Path, lines: Sequence[str]) -> Poses:
    """Poses of a csv, its columns by the names in the header; without one, t,x,y,theta."""
    data = [line for line in lines if line[0] != "#"]
    headed = bool(data) and not _is_number(data[0].partition(",")[0])
    if headed:
        names = _names(data[0])
        if not _is_complete(names):
            raise ValueError(f"{path}: got columns {data[0][:80]!r}, expected {','.join(CSV)}")
    else:
        remarks = (_names(line) for line in lines if line[0] == "#")
        names = next(filter(_is_complete, remarks), CSV)
    rows = [line.split(",") for line in data[headed:] if line[0] != "t"]  # headers in between
    return _poses(path, rows, names, ",")


def _names(header: str) -> tuple[str, ...]:
    """The columns of a header by our names, others as they are."""
    return tuple(_name(cell) for cell in header.lstrip("# ").split(","))


def _name(cell: str) -> str:
    name = UNIT.sub("", cell.strip().strip("\"'").lower()).replace(".", "_")
    for vector, short in VECTORS.items():
        if vector in name:
            name = short + name.rpartition(vector)[2]
    return OTHER_NAMES.get(name, name)


def _is_complete(names: Sequence[str]) -> bool:
    """Whether a pose can be made of the columns, in one way."""
    turned = names.count("theta") == 1 or all(names.count(name) == 1 for name in ROTATION)
    return turned and all(names.count(name) == 1 for name in CSV[:3])


def _poses(
    path: str | Path, rows: list[list[str]], names: tuple[str, ...], delimiter: str
) -> Poses:
    """The poses of rows of words under these names; nan where a quaternion is no rotation."""
    wrong = next((row for row in rows if len(row) != len(names)), None)
    expected = delimiter.join(names)
    if wrong is not None:
        raise ValueError(f"{path}: got {len(wrong)} columns, expected {expected}")
    needed = CSV if "theta" in names else (*CSV[:3], *ROTATION)
    places = [names.index(name) for name in needed]
    try:
        table = np.array([[row[k] for k in places] for row in rows], np.float64)
    except ValueError as error:
        raise ValueError(f"{path}: not lines of {expected} ({error})") from error
    table = table.reshape(-1, len(needed))
    heading = table[:, 3] if needed is CSV else _heading(table[:, 3:])
    return table[:, 0], np.column_stack([table[:, 1:3], heading])


def _heading(rotations: Floats) -> Floats:
    """Heading (n,) of quaternions (n, 4) of any length."""
    x, y, z, w = rotations.T
    with np.errstate(over="ignore", invalid="ignore"):  # no rotation
        heading = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
        is_rotation = np.linalg.norm(rotations, axis=1) > MIN_QUATERNION_NORM
    return np.where(is_rotation, heading, np.nan)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
