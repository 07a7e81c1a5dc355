"""Kernels of the byte map: 0 wall, 127 unknown, 255 free."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slams.jit import njit

UNKNOWN_VALUE = 127  # gray level
BORDER_CELLS = 50  # cells along the edges of the map that are neither scored nor drawn


@njit
def missing_cells(d: Any, directions: Any, pose: Any, shape: Any, cell: float, out: Any) -> None:
    """[Tsardoulias13] code: cells to add (left, right, low, high) so that every end point fits.

    d (n,) [m]; directions (n, 2) in the map; pose (x, y) cells from the corner; shape (ny, nx).
    """
    out[:] = 0
    for i in range(d.shape[0]):
        for axis in range(2):
            size = shape[1 - axis]
            at = d[i] / cell * directions[i, axis] + pose[axis] + 3.0
            if at < BORDER_CELLS and abs(at) > out[2 * axis]:
                out[2 * axis] = int(abs(at) + 100.0)
            if at >= size - BORDER_CELLS and abs(at - size) > out[2 * axis + 1]:
                out[2 * axis + 1] = int(abs(at - size) + 100.0)


@njit
def intensity_tables(intensity: float, free: float, hit: float, out_tables: Any) -> None:
    """[Tsardoulias13] code: new gray level after free, hit, and free then hit; (3, 256).

    intensity 0 to 1; free, hit are gray levels at intensity 1. Steps get smaller towards black and
    white. They have single precision and the result is truncated: 127 - 24 is 102, not 103.
    """
    for v in range(256):
        shrunk = 1.0 - math.sqrt(abs(v - UNKNOWN_VALUE) / 128.0)
        step = np.float32(shrunk * np.float32(intensity))
        freed = int(v + step * free)
        out_tables[0, v] = min(255, freed)
        out_tables[1, v] = max(0, int(v - step * hit))
        out_tables[2, v] = max(0, int(freed - step * hit))


@njit
def is_repeated(ends: Any, d: Any, i: int, increment: float) -> bool:
    """[Tsardoulias13] code: whether an earlier beam of the scan ends in the same cell."""
    radius = math.hypot(ends[i, 0], ends[i, 1])
    # maximum number of beams between end points in one cell, which on the axes is twice as wide
    near = int(3.0 / max(radius, 1.0) / abs(increment)) + 1
    for k in range(1, near + 1):
        for j in (i - k, i + k - len(d)):  # the last beams of a revolution are beside the first
            if 0 <= j < i and d[j] != 0.0 and ends[j, 0] == ends[i, 0] and ends[j, 1] == ends[i, 1]:
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
    """[Tsardoulias13] code, map update: a beam lightens its cells and darkens the last two.

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
            if min(ix, iy) < BORDER_CELLS or max(ix - nx, iy - ny) >= -BORDER_CELLS:
                break
            kind = 0 if r < length - 1 else (2 if r < length else 1)
            out[iy, ix] = tables[kind, out[iy, ix]]
        first = False
