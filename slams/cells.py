"""GridStorage: arrays as large as a map may become, with memory only where they are written.

Address space is free, and the system gives memory page by page at the first write. Arrays of a map
therefore cover from the beginning all that the map may hold in a square around the start. Only a
long, narrow building outgrows them; then the written part is copied to larger arrays.
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

PAGE_SIZE = mmap.PAGESIZE  # bytes
PAGEMAP = Path("/proc/self/pagemap")  # one word for every page of the address space
PAGE_IN_USE = np.uint64(3 << 62)  # bits of such a word: page in memory, page swapped
MIN_MAPPED_SIZE = 1 << 16  # bytes: smaller arrays come from numpy
MAP_NORESERVE = 0x4000  # Linux: memory is not reserved; in Python's mmap from 3.13 on
CACHE_CONFLICT_WIDTH = 1 << 10  # cells: rows that are a multiple of it share few cache lines
STORAGE_EDGE_RATIO = 2  # to the edge of the largest square map: long buildings seldom outgrow it
MIN_GROWTH_RATIO = 0.5  # of the edge, by which a storage grows


def zeros(shape: tuple[int, ...], dtype: DTypeLike) -> Array:
    """Like `np.zeros`; on Linux in small pages, which take memory at their first write.

    numpy requests pages of 2 MB: a wall across a large map would take the memory of all of it.
    """
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if sys.platform != "linux" or size < MIN_MAPPED_SIZE:
        return np.zeros(shape, dtype)
    memory = mmap.mmap(-1, size, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | MAP_NORESERVE)
    memory.madvise(mmap.MADV_NOHUGEPAGE)
    return np.frombuffer(memory, dtype).reshape(shape)


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Runs of set flags (n,): first index and length of each."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b - a)) for a, b in edges.reshape(-1, 2)]


def used_pages(low: int, high: int) -> NDArray[np.bool_]:
    """Pages from address `low` to `high` - 1 that take memory, others are zero; all if unknown."""
    first, n = low // PAGE_SIZE, (high - 1) // PAGE_SIZE + 1 - low // PAGE_SIZE
    try:
        words = np.fromfile(PAGEMAP, np.uint64, n, offset=8 * first)
    except OSError:
        return np.ones(n, np.bool_)
    return (words & PAGE_IN_USE) != 0 if len(words) == n else np.ones(n, np.bool_)


def nonzero_spans(array: Array) -> list[tuple[int, int]]:
    """Spans of bytes, first and end, that cover all of a contiguous array but zeros.

    They consist of blocks of the size of a page, counted from the array's first byte.
    """
    data, n = array.reshape(-1).view(np.uint8), -(-array.nbytes // PAGE_SIZE)
    used, spans = np.append(used_pages(*byte_bounds(array)), False), []
    for first, count in runs(used[:n] | used[1 : n + 1]):  # a block lies in two pages at most
        part = data[first * PAGE_SIZE : (first + count) * PAGE_SIZE]
        nonzero = np.logical_or.reduceat(part, np.arange(0, len(part), PAGE_SIZE))
        blocks = [(first + k, first + k + length) for k, length in runs(nonzero)]
        spans += [(PAGE_SIZE * low, min(PAGE_SIZE * high, array.nbytes)) for low, high in blocks]
    return spans


class GridStorage:
    """Rectangle of cells that the arrays of a map cover, in cells from the map's origin.

    Initially a square around the origin, `STORAGE_EDGE_RATIO` times as wide as one of `max_cells`.
    It is one block wider if rows would be whole pages: cells of a column would share a few lines of
    the cache, and an update of the map would take five times as long.

    Args:
        max_cells: cells of the largest map.
        cell: edge of a cell [m].
        block: cells along the edge of a block; the storage has whole blocks.
    """

    def __init__(self, max_cells: int, cell: float, block: int = 1) -> None:
        self._cell, self._block = cell, block
        half = max(STORAGE_EDGE_RATIO * math.isqrt(max_cells) // (2 * block), 1) * block
        self.x0 = self.y0 = -half
        self.width = self.height = 2 * half
        if self.width % CACHE_CONFLICT_WIDTH == 0:
            self.width += block

    @property
    def corner(self) -> tuple[float, float]:
        """Lower left corner of the cell [0, 0] of the arrays: x, y [m] from the origin."""
        return self.x0 * self._cell, self.y0 * self._cell

    def window(self, box: Box) -> tuple[slice, slice]:
        """Rows and columns of the cells that a box [m] touches."""
        x0, x1 = self._cut(box.x0, box.x1, self.x0, self.width)
        y0, y1 = self._cut(box.y0, box.y1, self.y0, self.height)
        return slice(y0, y1), slice(x0, x1)

    def reach(self, box: Box) -> tuple[int, int] | None:
        """Grow to cover a box [m]; returns the cells added below and at the left, None if none."""
        left, right = self._missing(box.x0, box.x1, self.x0, self.width)
        below, above = self._missing(box.y0, box.y1, self.y0, self.height)
        if not (left or right or below or above):
            return None
        self.x0, self.width = self.x0 - left, self.width + left + right
        self.y0, self.height = self.y0 - below, self.height + below + above
        return below, left

    def _cut(self, low: float, high: float, first: int, n: int) -> tuple[int, int]:
        begin = math.floor(low / self._cell) - first
        end = max(math.ceil(high / self._cell) - first, begin + 1)  # a point has a cell
        return min(max(begin, 0), n), min(max(end, 0), n)

    def _missing(self, low: float, high: float, first: int, n: int) -> tuple[int, int]:
        """Cells to add before and after the `n` of one axis."""
        before = first - math.floor(low / self._cell)
        after = math.ceil(high / self._cell) - first - n
        return self._blocks(before, n), self._blocks(after, n)

    def _blocks(self, missing: int, n: int) -> int:
        """Cells of the blocks to add on one side: many, so that arrays are seldom copied."""
        if missing <= 0:
            return 0
        return math.ceil((missing + MIN_GROWTH_RATIO * n) / self._block) * self._block


def observed(
    is_observed: NDArray[np.bool_],
    window: tuple[slice, slice],
    first: tuple[float, float],
    cell: float,
) -> tuple[tuple[slice, slice], tuple[float, float]] | None:
    """The part of a window of a map that was observed.

    Args:
        is_observed: of each cell of the window.
        window: rows and columns of the window in the map.
        first: center of the map's cell [0, 0], x, y [m].
        cell: edge of a cell [m].

    Returns:
        Rows and columns of the window and their corner x, y [m]; None if nothing was observed.
    """
    rows, columns = (np.flatnonzero(is_observed.any(axis=axis)) for axis in (1, 0))
    if rows.size == 0:
        return None
    part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    x = first[0] + (float(window[1].start + columns[0]) - 0.5) * cell
    y = first[1] + (float(window[0].start + rows[0]) - 0.5) * cell
    return part, (x, y)


def move(source: Array, target: Array, below: int, left: int) -> None:
    """Copy the nonzero cells to a larger array of zeros, which takes memory only for them."""
    size = source.strides[0]
    for row in sorted(
        {k for a, b in nonzero_spans(source) for k in range(a // size, -(-b // size))}
    ):
        columns = np.flatnonzero(source[row].reshape(source.shape[1], -1).any(axis=1))
        target[below + row, left + columns] = source[row, columns]
