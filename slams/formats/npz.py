"""Arrays in npz files: read when their sizes can be true, written whole or not at all."""

from __future__ import annotations

import io
import math
import os
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from slams.formats.files import complete_file
from slams.formats.packed import check_growth

PACKINGS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # what numpy writes
LOCKED = 1  # bit of a zip entry's flags
BROKEN = (zipfile.BadZipFile, zlib.error, EOFError, KeyError, OverflowError, RuntimeError)


def read_npz(path: Path, names: Iterable[str]) -> dict[str, NDArray[Any]]:
    """The arrays of these names that a file has; others are not unpacked.

    Raises:
        OSError: the file cannot be opened; one sentence, as all of these.
        ValueError: it is no npz, damaged, or an array claims a size that it cannot have.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            found = [name for name in names if name in archive.files]
            sizes = [_size(archive.zip, name) for name in found]
            check_growth(path, os.fstat(file.fileno()).st_size, sum(sizes))
            return {name: archive[name] for name in found}
    except BROKEN as error:
        raise ValueError(f"{path}: damaged or cut short ({error}); copy it again") from error
    except MemoryError as error:
        raise ValueError(f"{path}: needs more memory than there is ({error})") from error
    except ValueError as error:
        text = str(error)
        raise ValueError(text if text.startswith(str(path)) else f"{path}: {text}") from error
    except OSError as error:
        if error.strerror is None or error.filename is None:  # a place outside of the file
            raise ValueError(f"{path}: damaged or cut short ({error}); copy it again") from error
        raise type(error)(f"{path}: {error.strerror.lower()}; expected a scan log npz") from error


def _size(archive: zipfile.ZipFile, name: str) -> int:
    """Bytes of an array, of which zip entry and array header must say the same."""
    entry = archive.NameToInfo.get(f"{name}.npy") or archive.getinfo(name)
    if entry.compress_type not in PACKINGS or entry.flag_bits & LOCKED:
        raise ValueError(f"{name}: packed in a way that numpy does not pack")
    with archive.open(entry) as file:
        shape, dtype = _header(file)
        claimed = file.tell() + math.prod(shape) * dtype.itemsize
    if claimed != entry.file_size and not dtype.hasobject:  # objects numpy refuses itself
        raise EOFError(f"{name}: {claimed} bytes by its header, {entry.file_size} in the archive")
    return entry.file_size


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of the array that follows in the file."""
    version = np.lib.format.read_magic(file)
    read = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }
    if version not in read:
        raise ValueError(f"an array of format {version[0]}.{version[1]}; expected 1.0 or 2.0")
    shape, _, dtype = read[version](file)
    return shape, dtype


def write_npz(path: Path, arrays: dict[str, Any]) -> None:
    """As numpy's savez_compressed, but quicker; equal logs are equal files."""
    with complete_file(path) as partial, zipfile.ZipFile(partial, "w") as archive:
        for key, value in arrays.items():
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.asarray(value), allow_pickle=False)
            info = zipfile.ZipInfo(f"{key}.npy")  # has a fixed date
            archive.writestr(info, buffer.getvalue(), zipfile.ZIP_DEFLATED, compresslevel=1)
