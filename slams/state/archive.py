"""The file of a state: an npz of the arrays and, as JSON, what they belong to.

- `head`: the format, the release that wrote it, the algorithm, the tree of `slams.state.tree`;
  type, shape and filled bytes of each large array.
- `<attribute>`: an array; of a large one only its filled bytes.

The zip has a checksum of each.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from slams.cells import SMALL, filled, zeros
from slams.formats.npz import Arrays, read_npz, write_npz

FORMAT = "slams-state-3"
HEAD = "head"
COMPRESSION_LEVEL = 4  # level 1 makes constant arrays three times as large, 9 takes long
MAX_SIZE = 1 << 33  # bytes of all arrays unpacked: more than any map that fits in memory


def write(path: Path, algorithm: str, tree: Any, arrays: Arrays) -> None:
    """Write a label, a tree and its arrays by name; an older file is replaced by a whole one.

    Raises:
        OSError: the file cannot be written.
    """
    kept, large = dict(arrays), {}
    for name, array in arrays.items():
        if array.nbytes >= SMALL and array.flags.c_contiguous:
            spans, data = filled(array), array.reshape(-1).view(np.uint8)
            large[name] = [array.dtype.str, array.shape, spans]
            kept[name] = np.concatenate([data[:0], *(data[a:b] for a, b in spans)])
    head = _release() | {"algorithm": algorithm, "tree": tree, "large": large}
    text = json.dumps(head, separators=(",", ":")).encode()
    write_npz(path, kept | {HEAD: np.frombuffer(text, np.uint8)}, COMPRESSION_LEVEL)


def _release() -> dict[str, Any]:
    import slams

    return {"format": FORMAT, "slams": slams.__version__}


def read(path: Path) -> tuple[str, Any, Arrays]:
    """What `write` wrote: the algorithm's label, the tree and its arrays.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is no state, damaged, or of another release; one sentence.
    """
    with path.open("rb") as file:
        if file.read(2) != b"PK":
            raise ValueError(f"{path}: not a state; expected a file of --save-state")
    arrays = read_npz(path, most=MAX_SIZE)
    if HEAD not in arrays:
        raise ValueError(f"{path}: not a state: no {HEAD}; expected a file of --save-state")
    try:
        head = json.loads(arrays.pop(HEAD).tobytes())
        for key, expected in _release().items():
            if head.get(key) != expected:
                raise ValueError(
                    f"saved with {key} {head.get(key)}, expected {expected}: a state goes on with "
                    "the release that saved it; use that one, or map the log again"
                )
        for name, (dtype, shape, spans) in head["large"].items():
            arrays[name] = _whole(arrays[name], np.dtype(dtype), tuple(shape), spans)
        return head["algorithm"], head["tree"], arrays
    except Exception as error:  # a malformed head raises what it does
        raise ValueError(f"{path}: {sentence(error)}") from error


def _whole(data: Any, dtype: Any, shape: tuple[int, ...], spans: list[Any]) -> Any:
    """A large array of its filled bytes."""
    whole, at = zeros(shape, dtype), 0
    target = whole.reshape(-1).view(np.uint8)
    for a, b in spans:
        target[a:b] = data[at : at + b - a]
        at += b - a
    return whole


def sentence(error: Exception) -> str:
    """The start of an error's text, on one line."""
    text = str(error) if isinstance(error, ValueError) else f"damaged ({error!r})"
    return " ".join(text.split())[:200]
