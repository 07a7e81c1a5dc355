"""Memory of arrays: pieces of it that arrays share, of which untouched blocks are left out.

Arrays that overlap in memory lie in one piece, so that views stay views; of a large array that only
some rows are looked at, only those are kept. A piece is cut into blocks; a block that is nothing
but the piece's filling (zeros, nan, what a map is made of before it sees anything) takes no room.
"""

from __future__ import annotations

import ctypes
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.array_utils import byte_bounds
from numpy.typing import NDArray

from slams.cells import PAGE, given_pages, runs, zeros
from slams.jit import named

Array = NDArray[Any]
Bytes = NDArray[np.uint8]

BLOCK = 4096  # bytes
WORD = 8  # bytes of a filling; holds whole items of every type below
ALIGNED = 16  # bytes; where a piece begins between two of these is kept
KINDS = "biufc"  # bool, integers, floats, complex
NAMED = "named"  # the type of rows of named numbers begins so, their names follow
EMPTY = -1  # the piece of an array without items
MOST_RESERVED = 1 << 34  # bytes of all pieces; what nobody writes to takes no memory
MOST_FILLED = 1 << 32  # bytes of those whose filling is not zero: all of it is written


class Piece(NamedTuple):
    """One piece of memory: where it begins past an aligned address, bytes, filling, kept blocks.

    `runs` are (first block, number of blocks) that are not filling.
    """

    lead: int
    size: int
    filling: str
    runs: list[tuple[int, int]]


class View(NamedTuple):
    """An array in a piece: dtype, shape and strides [bytes], where its first item is."""

    piece: int
    dtype: str
    shape: list[int]
    strides: list[int]
    offset: int
    writeable: bool


class Layout:
    """Where in memory some arrays lie: spans of addresses, in the order they are first looked at.

    Arrays that overlap share a span.
    """

    def __init__(self, arrays: Iterable[Array]) -> None:
        some = [array for array in arrays if array.size]
        self._lows: list[int] = []
        highs: list[int] = []
        for low, high in sorted(map(byte_bounds, some)):
            if highs and low < highs[-1]:
                highs[-1] = max(highs[-1], high)
            else:
                self._lows.append(low)
                highs.append(high)
        order = dict.fromkeys(self._span(array) for array in some)
        self._numbers = {span: number for number, span in enumerate(order)}
        self.spans = [(self._lows[span], highs[span]) for span in order]

    def view(self, array: Array) -> View:
        """Where one of the arrays lies."""
        kind, shape, writeable = word_of(array.dtype), list(array.shape), array.flags.writeable
        if not array.size:
            return View(EMPTY, kind, shape, [], 0, writeable)
        span = self._span(array)
        offset = _address(array) - self._lows[span]
        return View(self._numbers[span], kind, shape, list(array.strides), offset, writeable)

    def _span(self, array: Array) -> int:
        return bisect_right(self._lows, _address(array)) - 1


def _address(array: Array) -> int:
    return int(array.__array_interface__["data"][0])


def look_at(low: int, high: int) -> Bytes:
    """The bytes between two addresses of arrays that live."""
    memory = (ctypes.c_ubyte * (high - low)).from_address(low)
    return np.frombuffer(memoryview(memory).cast("B"), np.uint8)


def pack(low: int, high: int) -> tuple[Piece, Iterator[Bytes]]:
    """What a piece is called in the file, and the bytes to keep of it, in order."""
    data = look_at(low, high)
    blocks = len(data) // BLOCK
    whole = data[: blocks * BLOCK].view(np.uint64).reshape(blocks, BLOCK // WORD)
    filling = whole[-1, -1] if blocks else np.uint64(0)
    kept = _looked_at(low, blocks) if filling == 0 else np.ones(blocks, np.bool_)
    for a, n in runs(kept):
        kept[a : a + n] = (whole[a : a + n] != filling).any(axis=1)
    not_filling = runs(np.append(kept, len(data) > blocks * BLOCK))
    piece = Piece(low % ALIGNED, len(data), filling.tobytes().hex(), not_filling)
    return piece, (data[a * BLOCK : (a + n) * BLOCK] for a, n in not_filling)


def _looked_at(low: int, blocks: int) -> NDArray[np.bool_]:
    """Which blocks from an address on may be something else than zeros."""
    if not blocks:
        return np.zeros(0, np.bool_)
    given = given_pages(low, low + blocks * BLOCK)
    begin = low % PAGE + BLOCK * np.arange(blocks)
    return np.asarray(given[begin // PAGE] | given[(begin + BLOCK - 1) // PAGE])


def kept_size(pieces: list[Piece]) -> int:
    """Bytes that the pieces keep in the file, after a check that they can be.

    Raises:
        ValueError: sizes that no state has.
    """
    for piece in pieces:
        _check(piece)
    reserved = sum(piece.lead + piece.size for piece in pieces)
    filled = sum(piece.size for piece in pieces if int(piece.filling, 16))
    if reserved > MOST_RESERVED or filled > MOST_FILLED:
        raise ValueError(
            f"its arrays take {1e-9 * reserved:.1f} GB, expected {1e-9 * MOST_RESERVED:.1f} at most"
        )
    return sum(_length(piece, run) for piece in pieces for run in piece.runs)


def _check(piece: Piece) -> None:
    at, blocks = 0, -(-piece.size // BLOCK)
    for first, number in piece.runs:
        if first < at or number < 1 or first + number > blocks:
            raise ValueError(f"blocks {first} and {number} more in a piece of {blocks}")
        at = first + number
    good = 0 <= piece.lead < ALIGNED and piece.size > 0 and len(piece.filling) == 2 * WORD
    if not good:
        raise ValueError(f"a piece of {piece.size} bytes that begins at {piece.lead}")
    int(piece.filling, 16)


def _length(piece: Piece, run: tuple[int, int]) -> int:
    return min((run[0] + run[1]) * BLOCK, piece.size) - run[0] * BLOCK


def unpack(piece: Piece, kept: Bytes) -> tuple[Bytes, Bytes]:
    """A piece from the bytes that were kept of it and all that follow; and those that follow."""
    data = _filled(piece)
    for run in piece.runs:
        length = _length(piece, run)
        data[run[0] * BLOCK : run[0] * BLOCK + length] = kept[:length]
        kept = kept[length:]
    return data, kept


def _filled(piece: Piece) -> Bytes:
    """The piece before anything is written to it; of zeros it costs nothing yet."""
    if not int(piece.filling, 16):
        return zeros((piece.lead + piece.size,), np.uint8)[piece.lead :]
    word = np.frombuffer(bytes.fromhex(piece.filling), np.uint8)
    data = np.empty(piece.lead + piece.size, np.uint8)[piece.lead :]
    whole = piece.size // WORD * WORD
    data[:whole].reshape(-1, WORD)[:] = word
    return data


def array_of(view: View, pieces: list[Bytes]) -> Array:
    """The array that a view describes.

    Raises:
        ValueError: it does not lie in its piece.
    """
    dtype = type_of(view.dtype)
    if view.piece == EMPTY:
        array: Array = np.empty(view.shape, dtype)
        if array.size:
            raise ValueError(f"an array {tuple(view.shape)} without memory")
    else:
        memory = pieces[_index(view.piece, len(pieces))]
        array = np.ndarray(view.shape, dtype, memory, view.offset, view.strides)
    array.flags.writeable = view.writeable
    return array


def word_of(dtype: np.dtype[Any]) -> str:
    """What a type of numbers, or of rows of named ones, is called in a state; "" for any other."""
    if dtype.kind in KINDS:
        return dtype.str
    names = " ".join(dtype.names or ())
    return f"{NAMED} {names}" if names and dtype == named(names) else ""


def type_of(word: str) -> np.dtype[Any]:
    """The type that is called so.

    Raises:
        ValueError: it is none of numbers.
    """
    first, _, names = word.partition(" ")
    if first == NAMED and all(name.isidentifier() for name in names.split(" ")):
        dtype: np.dtype[Any] = named(names)
    else:
        dtype = np.dtype(word)
    if word_of(dtype) != word:
        raise ValueError(f"an array of {word}; expected numbers")
    return dtype


def _index(number: int, n: int) -> int:
    if not 0 <= number < n:
        raise ValueError(f"piece {number} of {n}")
    return number
