"""GridStorage: arrays as large as a map may become, memory only where something was written.

Address space costs nothing, and the system gives memory page by page to what is written to. So the
arrays of a map begin with room for all that it may hold in a square around the start; only a long,
narrow building outgrows them, and then what was touched is moved to larger ones.
"""

from __future__ import annotations

import math
import mmap
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.array_utils import byte_bounds
from numpy.typing import DTypeLike, NDArray

from slams.grid_bounds import Box

Array = NDArray[Any]

PAGE = mmap.PAGESIZE
PAGEMAP = Path("/proc/self/pagemap")  # a word for every page of the address space
GIVEN = np.uint64(3 << 62)  # of such a word: in memory, swapped
SMALL = 1 << 16  # bytes that may lie anywhere
NORESERVE = 0x4000  # Linux: no promise of memory; Python has a name for it from 3.13 on
EVEN = 1 << 10  # cells: of four bytes a page, and as many as the sets of a cache share
EDGE = 2  # times that of the largest square map: a long building seldom outgrows it
SPARE = 0.5  # of its edge that a room which is too small grows at least


def zeros(shape: tuple[int, ...], dtype: DTypeLike) -> Array:
    """As `np.zeros`; on Linux in small pages, each taken from the system when it is written to.

    numpy asks for pages of 2 MB, so that a wall across a large map takes the memory of all of it.
    """
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if sys.platform != "linux" or size < SMALL:
        return np.zeros(shape, dtype)
    memory = mmap.mmap(-1, size, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | NORESERVE)
    memory.madvise(mmap.MADV_NOHUGEPAGE)
    return np.frombuffer(memory, dtype).reshape(shape)


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Where flags (n,) are set: first and number of each run."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b - a)) for a, b in edges.reshape(-1, 2)]


def given_pages(low: int, high: int) -> NDArray[np.bool_]:
    """Which pages from that of address `low` to that of `high` - 1 have ever been looked at.

    The others are zeros, and take no memory. All of them where the system does not tell.
    """
    first, n = low // PAGE, (high - 1) // PAGE + 1 - low // PAGE
    try:
        words = np.fromfile(PAGEMAP, np.uint64, n, offset=8 * first)
    except OSError:
        return np.ones(n, np.bool_)
    return (words & GIVEN) != 0 if len(words) == n else np.ones(n, np.bool_)


def filled(array: Array) -> list[tuple[int, int]]:
    """Spans of a contiguous array's bytes, first and end, outside of which all are zero.

    They are of whole blocks as large as pages, counted from the array's first byte.
    """
    data, n = array.reshape(-1).view(np.uint8), -(-array.nbytes // PAGE)
    given, spans = np.append(given_pages(*byte_bounds(array)), False), []
    for first, count in runs(given[:n] | given[1 : n + 1]):  # a block lies in two pages at most
        part = data[first * PAGE : (first + count) * PAGE]
        some = np.logical_or.reduceat(part, np.arange(0, len(part), PAGE))
        blocks = [(first + k, first + k + more) for k, more in runs(some)]
        spans += [(PAGE * low, min(PAGE * high, array.nbytes)) for low, high in blocks]
    return spans


class GridStorage:
    """The rectangle of cells that a map's arrays have, as numbers of cells from the map's origin.

    It begins as a square around the origin, `EDGE` times as wide as one of `max_cells`; a block
    wider where rows would be whole pages: cells above each other would all want the same few lines
    of the cache, and scans would enter a map five times as slowly.

    Args:
        max_cells: cells of the largest map.
        cell: edge of a cell [m].
        block: cells along the edge of what is added as a whole.
    """

    def __init__(self, max_cells: int, cell: float, block: int = 1) -> None:
        self._cell, self._block = cell, block
        half = max(EDGE * math.isqrt(max_cells) // (2 * block), 1) * block
        self.x0 = self.y0 = -half
        self.width = self.height = 2 * half
        if self.width % EVEN == 0:
            self.width += block

    @property
    def corner(self) -> tuple[float, float]:
        """Where the cell [0, 0] of the arrays begins: x, y [m] from the origin."""
        return self.x0 * self._cell, self.y0 * self._cell

    def window(self, box: Box) -> tuple[slice, slice]:
        """Rows and columns of the cells that a box [m] touches."""
        x0, x1 = self._cut(box.x0, box.x1, self.x0, self.width)
        y0, y1 = self._cut(box.y0, box.y1, self.y0, self.height)
        return slice(y0, y1), slice(x0, x1)

    def reach(self, box: Box) -> tuple[int, int] | None:
        """Grow until a box [m] is inside; cells added below and at the left, None if none are."""
        left, right = self._missing(box.x0, box.x1, self.x0, self.width)
        below, above = self._missing(box.y0, box.y1, self.y0, self.height)
        if not (left or right or below or above):
            return None
        self.x0, self.width = self.x0 - left, self.width + left + right
        self.y0, self.height = self.y0 - below, self.height + below + above
        return below, left

    def _cut(self, low: float, high: float, first: int, n: int) -> tuple[int, int]:
        begin = math.floor(low / self._cell) - first
        end = max(math.ceil(high / self._cell) - first, begin + 1)  # a point is in a cell, too
        return min(max(begin, 0), n), min(max(end, 0), n)

    def _missing(self, low: float, high: float, first: int, n: int) -> tuple[int, int]:
        """Cells to add before and after the `n` of one axis: seldom, and many."""
        before = first - math.floor(low / self._cell)
        after = math.ceil(high / self._cell) - first - n
        return self._blocks(before, n), self._blocks(after, n)

    def _blocks(self, missing: int, n: int) -> int:
        if missing <= 0:
            return 0
        return math.ceil((missing + SPARE * n) / self._block) * self._block


def observed(
    seen: NDArray[np.bool_],
    window: tuple[slice, slice],
    first: tuple[float, float],
    cell: float,
) -> tuple[tuple[slice, slice], tuple[float, float]] | None:
    """Rows and columns of the cells of a window that were observed, and where they begin.

    Args:
        seen: whether each cell of the window was.
        window: rows and columns of the window in the map.
        first: center of the map's cell [0, 0], x, y [m].
        cell: edge of a cell [m].

    Returns:
        The part of the window and its corner x, y [m]; None if nothing was observed.
    """
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    if rows.size == 0:
        return None
    part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    x = first[0] + (float(window[1].start + columns[0]) - 0.5) * cell
    y = first[1] + (float(window[0].start + rows[0]) - 0.5) * cell
    return part, (x, y)


def move(source: Array, target: Array, below: int, left: int) -> None:
    """Copy rows of cells into a larger array of zeros; what was never touched stays so there."""
    size = source.strides[0]
    for row in sorted({k for a, b in filled(source) for k in range(a // size, -(-b // size))}):
        columns = np.flatnonzero(source[row].reshape(source.shape[1], -1).any(axis=1))
        target[below + row, left + columns] = source[row, columns]
