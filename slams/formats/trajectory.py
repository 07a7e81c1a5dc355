"""Trajectories: csv (t,x,y,theta) and the TUM format that evo and others read."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slams.types import Floats


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


def read_csv(path: str | Path) -> tuple[Floats, Floats]:
    """Read what `write_csv` wrote: t (n,) and poses (n, 3).

    Raises:
        ValueError: the file has other columns.
    """
    try:
        table = np.loadtxt(path, delimiter=",", ndmin=2, comments=("#", "t"))
    except ValueError as error:
        raise ValueError(f"{path}: not lines of t,x,y,theta ({error})") from error
    if table.shape[1] != 4:
        raise ValueError(f"{path}: got {table.shape[1]} columns, expected t,x,y,theta")
    return table[:, 0], table[:, 1:]
