"""Arrays in npz files, with a limit on the unpacked size; written completely or not at all."""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slams.formats.files import complete_file
from slams.formats.packed import check_growth

Arrays = dict[str, NDArray[Any]]


def read_npz(path: Path, names: Iterable[str] | None = None, most: int = 0) -> Arrays:
    """The arrays with the given names that a file has, None for all; others are not unpacked.

    `most` is the number of bytes that a file of any size may unpack to.

    Raises:
        OSError: the file cannot be opened.
        ValueError: the file is no npz, damaged, or unpacks to an implausible size.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            found = [name for name in names or archive.files if name in archive.files]
            size = sum(archive.zip.getinfo(f"{name}.npy").file_size for name in found)
            if size > most:
                check_growth(path, os.fstat(file.fileno()).st_size, size)
            return {name: archive[name] for name in found}
    except MemoryError as error:
        raise ValueError(f"{path}: needs more memory than is available ({error})") from error
    except Exception as error:  # zipfile, its decompressors and numpy raise errors of any class
        if isinstance(error, ValueError) and str(error).startswith(str(path)):
            raise
        if isinstance(error, OSError) and error.strerror and error.filename:
            raise type(error)(f"{path}: {error.strerror.lower()}; expected an npz file") from error
        reason = " ".join(str(error).split())[:200]
        text = f"{path}: damaged, cut short or no npz ({reason}); copy it again"
        raise ValueError(text) from error


def write_npz(path: Path, arrays: dict[str, Any], level: int = 1) -> None:
    """Write arrays like numpy's savez_compressed, but faster; equal arrays give equal files."""
    with complete_file(path) as partial, zipfile.ZipFile(partial, "w") as archive:
        for key, value in arrays.items():
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.asarray(value), allow_pickle=False)
            info = zipfile.ZipInfo(f"{key}.npy")  # with a constant date
            archive.writestr(info, buffer.getvalue(), zipfile.ZIP_DEFLATED, compresslevel=level)
