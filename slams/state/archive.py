"""The file of a state: a zip of arrays (.npy, as in an npz) and JSON, with a digest of all of it.

- `head.json`: the format, the release that wrote it, the algorithm, sha256 of all other entries.
- `tree.json`: the tree of `slams.state.tree`; type, shape and filled bytes of each large array.
- `<attribute>.npy`: an array; of a large one only its filled bytes.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slams.cells import SMALL, filled, zeros
from slams.formats.files import complete_file

Array = NDArray[Any]

FORMAT = "slams-state-2"
HEAD, TREE = "head.json", "tree.json"
COMPRESSION_LEVEL = 4  # level 1 makes constant arrays three times as large, 9 takes long
MAX_SIZE = 1 << 33  # bytes of all entries unpacked: more than any map that fits in memory
Arrays = dict[str, Array]


def write(path: Path, algorithm: str, tree: Any, arrays: Arrays) -> None:
    """Write a label, a tree and its arrays by name; an older file is replaced by a whole one.

    Raises:
        OSError: the file cannot be written.
    """
    digest, large = hashlib.sha256(), {}
    with complete_file(path) as partial, zipfile.ZipFile(partial, "w") as archive:
        for name, array in arrays.items():
            kept = array
            if array.nbytes >= SMALL and array.flags.c_contiguous:
                spans, data = filled(array), array.reshape(-1).view(np.uint8)
                large[name] = [array.dtype.str, array.shape, spans]
                kept = np.concatenate([data[:0], *(data[a:b] for a, b in spans)])
            file = io.BytesIO()
            np.lib.format.write_array(file, kept, allow_pickle=False)
            _add(archive, f"{name}.npy", file.getvalue(), digest)
        text = json.dumps({"tree": tree, "large": large}, separators=(",", ":"))
        _add(archive, TREE, text.encode(), digest)
        head = _release() | {"algorithm": algorithm, "sha256": digest.hexdigest()}
        _add(archive, HEAD, json.dumps(head, indent=1).encode(), digest)


def _release() -> dict[str, Any]:
    import slams

    return {"format": FORMAT, "slams": slams.__version__}


def _add(archive: zipfile.ZipFile, name: str, data: bytes, digest: Any) -> None:
    entry = zipfile.ZipInfo(name)  # has a fixed date: equal states are equal files
    archive.writestr(entry, data, zipfile.ZIP_DEFLATED, COMPRESSION_LEVEL)
    digest.update(name.encode() + data)


def read(path: Path) -> tuple[str, Any, Arrays]:
    """What `write` wrote: the algorithm's label, the tree and its arrays.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is no state, damaged, or of another release; one sentence.
    """
    with path.open("rb") as file:
        if file.read(2) != b"PK":
            raise ValueError(f"{path}: not a state; expected a file of --save-state")
        try:
            with zipfile.ZipFile(file) as archive:
                return _read(archive)
        except ValueError as error:
            raise ValueError(f"{path}: {sentence(error)}") from error
        except Exception as error:  # zipfile, zlib and numpy raise what they stumble over
            text = f"{path}: damaged or cut short ({sentence(error)}); copy or save it again"
            raise ValueError(text) from error


def sentence(error: Exception) -> str:
    """The start of an error's text, on one line."""
    return " ".join(str(error).split())[:200]


def _read(archive: zipfile.ZipFile) -> tuple[str, Any, Arrays]:
    if HEAD not in archive.namelist():
        raise ValueError(f"not a state: no {HEAD}; expected a file of --save-state")
    size = sum(entry.file_size for entry in archive.infolist())
    if size > MAX_SIZE:
        raise ValueError(f"unpacks to {size} bytes, expected {MAX_SIZE} at most")
    head = json.loads(archive.read(HEAD))
    for key, expected in _release().items():
        if head.get(key) != expected:
            raise ValueError(
                f"saved with {key} {head.get(key)}, expected {expected}: a state goes on with the "
                "release that saved it; use that one, or map the log again"
            )
    entries = {name: archive.read(name) for name in archive.namelist() if name != HEAD}
    digest = hashlib.sha256()
    for name, data in entries.items():
        digest.update(name.encode() + data)
    if digest.hexdigest() != head["sha256"]:
        raise ValueError("changed since it was saved: its sha256 differs; save it again")
    known = json.loads(entries.pop(TREE))
    arrays: Arrays = {
        name.removesuffix(".npy"): np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
        for name, data in entries.items()
    }
    for name, (dtype, shape, spans) in known["large"].items():
        whole, at = zeros(tuple(shape), np.dtype(dtype)), 0
        target = whole.reshape(-1).view(np.uint8)
        for a, b in spans:
            target[a:b] = arrays[name][at : at + b - a]
            at += b - a
        arrays[name] = whole
    return head["algorithm"], known["tree"], arrays
