"""The map of bytes, 0 (wall) .. 127 (unknown) .. 255 (free), in scalar loops."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slams.jit import njit

UNKNOWN = 127

BORDER = 50  # cells at the rim of the map that are neither scored nor drawn


@njit
def reach(d: Any, directions: Any, pose: Any, shape: Any, cell: float, out_grow: Any) -> None:
    """[Tsardoulias13] code: cells to add (left, right, low, high) so that every end point fits.

    d (n,) [m]; directions (n, 2) in the map; pose (x, y) cells from the corner; shape (ny, nx).
    """
    out_grow[:] = 0
    for i in range(d.shape[0]):
        for axis in range(2):
            size = shape[1 - axis]
            at = d[i] / cell * directions[i, axis] + pose[axis] + 3.0
            if at < BORDER and abs(at) > out_grow[2 * axis]:
                out_grow[2 * axis] = int(abs(at) + 100.0)
            if at >= size - BORDER and abs(at - size) > out_grow[2 * axis + 1]:
                out_grow[2 * axis + 1] = int(abs(at - size) + 100.0)


@njit
def intensity_tables(intensity: float, free: float, hit: float, out_tables: Any) -> None:
    """[Tsardoulias13] code: new value of a byte after free, hit, and free then hit; (3, 256).

    intensity 0 to 1; free, hit gray levels at 1. The step shrinks towards black and white; the
    value is cut to int, and the step is of single precision: 127 - 24 is 102 then, not 103.
    """
    for v in range(256):
        shrunk = 1.0 - math.sqrt(abs(v - UNKNOWN) / 128.0)
        step = np.float32(shrunk * np.float32(intensity))
        freed = int(v + step * free)
        out_tables[0, v] = min(255, freed)
        out_tables[1, v] = max(0, int(v - step * hit))
        out_tables[2, v] = max(0, int(freed - step * hit))


@njit
def is_repeated(ends: Any, d: Any, i: int, increment: float) -> bool:
    """[Tsardoulias13] code: an earlier beam of the scan ends in the same cell."""
    radius = math.hypot(ends[i, 0], ends[i, 1])
    # end points in one cell, twice as wide on the axes, are no further apart than this
    near = int(3.0 / max(radius, 1.0) / abs(increment)) + 1
    for j in range(max(0, i - near), i):
        if d[j] != 0.0 and ends[j, 0] == ends[i, 0] and ends[j, 1] == ends[i, 1]:
            return True
    return False


@njit
def draw(
    d: Any,
    ends: Any,
    directions: Any,
    increment: float,
    pose: Any,
    cell: float,
    tables: Any,
    out: Any,
) -> None:
    """[Tsardoulias13] code, map update: every beam whitens its way and blackens its last two cells.

    d (n,) [m]; directions (n, 2) in the map; pose (x, y) cells from the corner; out (ny, nx) uint8.
    """
    ny, nx = out.shape
    first = True
    for i in range(d.shape[0]):
        if d[i] == 0.0 or is_repeated(ends, d, i, increment):
            continue
        length = int(d[i] / cell)
        for r in range(0 if first else 1, length + 1):
            ix = int(r * directions[i, 0] + pose[0])
            iy = int(r * directions[i, 1] + pose[1])
            if ix < BORDER or iy < BORDER or ix >= nx - BORDER or iy >= ny - BORDER:
                break
            kind = 0 if r < length - 1 else (2 if r < length else 1)
            out[iy, ix] = tables[kind, out[iy, ix]]
        first = False
