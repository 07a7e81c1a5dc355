"""Text files, plain or compressed by gzip, with a limit on the unpacked size."""

from __future__ import annotations

import gzip
import io
import zlib
from pathlib import Path

GZIP_MAGIC = b"\x1f\x8b"
MIN_UNPACKED_LIMIT = 256 << 20  # bytes that any file may unpack to
MAX_UNPACKING_RATIO = 50  # of unpacked to packed size beyond that; recordings have 3 to 20
UNPACKED_BLOCK_SIZE = 1 << 16  # bytes that are unpacked at a time


def text_of(path: Path) -> str:
    """The content of a text file, compressed by gzip or not.

    Raises:
        OSError: the file cannot be opened.
        ValueError: the file is cut short or corrupt, or unpacks to an implausible size.
    """
    data = path.read_bytes()
    if not data.startswith(GZIP_MAGIC):
        return data.decode("latin-1")
    text, reason = unpacked(data, max(MIN_UNPACKED_LIMIT, MAX_UNPACKING_RATIO * len(data)) + 1)
    check_growth(path, len(data), len(text))
    if reason:
        raise ValueError(f"{path}: {reason}; copy it again, or unpack the undamaged part by zcat")
    return text.decode("latin-1")


def name_of(path: Path) -> str:
    """The name of a log: the file's name without its endings."""
    return path.resolve().name.removesuffix(".gz").rpartition(".")[0] or path.resolve().name


def check_growth(path: str | Path, size: int, unpacked_size: int) -> None:
    """Refuse a file of an implausible unpacked size [bytes] before memory is allocated for it.

    Raises:
        ValueError: the file of this size [bytes] would unpack to more than any recording.
    """
    if unpacked_size > max(MIN_UNPACKED_LIMIT, MAX_UNPACKING_RATIO * size):
        raise ValueError(
            f"{path}: unpacks to {1e-9 * unpacked_size:.1f} GB or more from {1e-6 * size:.1f} MB, "
            "as no recording does; if this is one, give it unpacked"
        )


def unpacked(data: bytes, most: int) -> tuple[bytes, str]:
    """The unpacked content of gzip data, at most `most` bytes, and its damage or ""."""
    text, block = bytearray(), UNPACKED_BLOCK_SIZE
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as file:
            while len(text) < most and (part := file.read1(min(block, most - len(text)))):
                text += part
    except EOFError:
        return bytes(text), "packed data end too early"
    except (zlib.error, OSError):
        return bytes(text), "packed data are corrupt"
    return bytes(text), ""
