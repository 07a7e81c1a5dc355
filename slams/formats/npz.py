"""Arrays in npz files: read when their sizes can be true, written whole or not at all."""

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
    """The arrays of these names that a file has, None for all; others are not unpacked.

    `most` is the number of bytes that a file of any size may unpack to.

    Raises:
        OSError: the file cannot be opened; one sentence, as all of these.
        ValueError: it is no npz, damaged, or unpacks to more than can be.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            found = [name for name in names or archive.files if name in archive.files]
            size = sum(archive.zip.getinfo(f"{name}.npy").file_size for name in found)
            if size > most:
                check_growth(path, os.fstat(file.fileno()).st_size, size)
            return {name: archive[name] for name in found}
    except MemoryError as error:
        raise ValueError(f"{path}: needs more memory than there is ({error})") from error
    except Exception as error:  # zipfile, its decompressors and numpy raise what they stumble over
        if isinstance(error, ValueError) and str(error).startswith(str(path)):
            raise
        if isinstance(error, OSError) and error.strerror and error.filename:
            raise type(error)(f"{path}: {error.strerror.lower()}; expected an npz file") from error
        reason = " ".join(str(error).split())[:200]  # also of a place outside of the file
        what = f"{path}: damaged, cut short or no npz ({reason}); copy it again"
        raise ValueError(what) from error


def write_npz(path: Path, arrays: dict[str, Any], level: int = 1) -> None:
    """As numpy's savez_compressed, but quicker; equal arrays are equal files."""
    with complete_file(path) as partial, zipfile.ZipFile(partial, "w") as archive:
        for key, value in arrays.items():
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.asarray(value), allow_pickle=False)
            info = zipfile.ZipInfo(f"{key}.npy")  # has a fixed date
            archive.writestr(info, buffer.getvalue(), zipfile.ZIP_DEFLATED, compresslevel=level)
