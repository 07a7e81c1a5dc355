"""Text files as they lie on disk: plain, or packed by gzip, perhaps not to their end."""

from __future__ import annotations

import zlib
from pathlib import Path

from slams.formats.options import DamagedError

GZIP = b"\x1f\x8b"
ROOM = 256 << 20  # bytes that any file may unpack to
GROWTH = 50  # times its size beyond that; recordings grow 3 to 20 times


def text_of(path: Path, salvage: bool, notes: list[str]) -> str:
    """A text file, packed by gzip or not. What is cut short is refused, or read as far as it goes.

    Raises:
        OSError: the file cannot be opened.
        DamagedError: the packed file is cut short or corrupt.
    """
    data = path.read_bytes()
    if not data.startswith(GZIP):
        return data.decode("latin-1")
    text, reason = all_unpacked(path, data)
    if reason and not salvage:
        raise DamagedError(f"{path}: {reason}; copy it again, or --salvage what is whole")
    if reason:
        notes.append(f"{reason}; read as far as it goes")
    return text.decode("latin-1")


def name_of(path: Path) -> str:
    """What a log is called: the file's name without its endings."""
    return path.resolve().name.removesuffix(".gz").rpartition(".")[0] or path.resolve().name


def check_growth(path: str | Path, size: int, unpacked_size: int) -> None:
    """Refuse, before memory is taken for it, what packs better than any recording.

    Raises:
        ValueError: so much cannot come of a file of this size [bytes].
    """
    if unpacked_size > _room(size):
        raise ValueError(
            f"{path}: unpacks to {1e-9 * unpacked_size:.1f} GB or more from {1e-6 * size:.1f} MB, "
            "as no recording does; if this is one, give it unpacked"
        )


def _room(size: int) -> int:
    return max(ROOM, GROWTH * size)


def all_unpacked(path: str | Path, data: bytes) -> tuple[bytes, str]:
    """As `unpacked`, all of it.

    Raises:
        ValueError: it is more than a recording packs.
    """
    text, reason = unpacked(data, _room(len(data)) + 1)
    check_growth(path, len(data), len(text))
    return text, reason


def unpacked(data: bytes, most: int = 0) -> tuple[bytes, str]:
    """What gzip packed, at most so many bytes (0 = all), and what is wrong with it if anything."""
    parts, size = [], 0
    while data.startswith(GZIP):
        stream = zlib.decompressobj(wbits=31)
        try:
            parts.append(stream.decompress(data, max(most - size, 1) if most else 0))
        except zlib.error:
            return b"".join([*parts, _whole_start(data)]), "packed data are corrupt"
        size += len(parts[-1])
        if most and size >= most:
            return b"".join(parts), ""
        if not stream.eof:
            return b"".join(parts), "packed data end too early"
        data = stream.unused_data
    return b"".join(parts), ""


def _whole_start(data: bytes, step: int = 4096) -> bytes:
    """As much as unpacks before the first fault."""
    stream, parts = zlib.decompressobj(wbits=31), []
    try:
        for start in range(0, len(data), step):
            parts.append(stream.decompress(data[start : start + step]))
    except zlib.error:
        pass
    return b"".join(parts)
