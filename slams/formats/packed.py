"""Text files as they lie on disk: plain, or packed by gzip."""

from __future__ import annotations

import gzip
import io
import zlib
from pathlib import Path

GZIP_MAGIC = b"\x1f\x8b"
MIN_UNPACKED_LIMIT = 256 << 20  # bytes that any file may unpack to
MAX_UNPACKING_RATIO = 50  # times its size beyond that; recordings grow 3 to 20 times
UNPACKED_BLOCK_SIZE = 1 << 16  # bytes that are unpacked at a time


def text_of(path: Path) -> str:
    """A text file, packed by gzip or not.

    Raises:
        OSError: the file cannot be opened.
        ValueError: the packed file is cut short or corrupt, or unpacks to more than can be.
    """
    data = path.read_bytes()
    if not data.startswith(GZIP_MAGIC):
        return data.decode("latin-1")
    text, reason = unpacked(data, max(MIN_UNPACKED_LIMIT, MAX_UNPACKING_RATIO * len(data)) + 1)
    check_growth(path, len(data), len(text))
    if reason:
        raise ValueError(f"{path}: {reason}; copy it again, or unpack what is whole by zcat")
    return text.decode("latin-1")


def name_of(path: Path) -> str:
    """What a log is called: the file's name without its endings."""
    return path.resolve().name.removesuffix(".gz").rpartition(".")[0] or path.resolve().name


def check_growth(path: str | Path, size: int, unpacked_size: int) -> None:
    """Refuse, before memory is taken for it, what packs better than any recording.

    Raises:
        ValueError: so much cannot come of a file of this size [bytes].
    """
    if unpacked_size > max(MIN_UNPACKED_LIMIT, MAX_UNPACKING_RATIO * size):
        raise ValueError(
            f"{path}: unpacks to {1e-9 * unpacked_size:.1f} GB or more from {1e-6 * size:.1f} MB, "
            "as no recording does; if this is one, give it unpacked"
        )


def unpacked(data: bytes, most: int) -> tuple[bytes, str]:
    """What gzip packed, at most so many bytes, and what is wrong with it if anything."""
    text = bytearray()
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as file:
            while len(text) < most and (
                part := file.read1(min(UNPACKED_BLOCK_SIZE, most - len(text)))
            ):
                text += part
    except EOFError:
        return bytes(text), "packed data end too early"
    except (zlib.error, OSError):
        return bytes(text), "packed data are corrupt"
    return bytes(text), ""
