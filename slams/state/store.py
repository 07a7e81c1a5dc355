"""Save an algorithm, load it, and resume it in another run.

The file is an npz of arrays and a JSON header; the zip has a checksum of each.

- `head`: the format, the release, the algorithm, the tree of `slams.state.tree`, and the type,
  shape and filled bytes of each large array.
- `<attribute>`: an array; of a large array only the filled bytes.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from slams import __version__
from slams.cells import MIN_MAPPED_SIZE, nonzero_spans, zeros
from slams.formats.files import check_file
from slams.formats.npz import Arrays, read_npz, write_npz
from slams.registry import find, label_of
from slams.state.tree import Reader, Writer

if TYPE_CHECKING:
    from slams.params import Params
    from slams.scanlog import ScanLog
    from slams.types import Ranges, Slam

STATE_VERSION = {"format": "slams-state-5", "slams": __version__}
HEADER_KEY = "head"
COMPRESSION_LEVEL = 4  # level 1 makes constant arrays three times as large, 9 takes long
MAX_STATE_SIZE = 1 << 33  # bytes of all arrays, unpacked; no map that fits into memory is larger


class State(NamedTuple):
    """The contents of a file: the algorithm, and the caller's values `beside` it."""

    slam: Slam
    beside: dict[str, Any]


def save(slam: Slam, path: str | Path, beside: Mapping[str, Any] | None = None) -> None:
    """Write an algorithm with its map to one file, complete or not at all.

    Args:
        slam: any algorithm whose attributes are numbers, arrays, lists, dicts and objects of
            classes of its own package.
        path: the file; an existing file is replaced once the new one is complete.
        beside: values of the caller to be saved, too: numbers, texts, lists.

    Raises:
        OSError: the file cannot be written.
        TypeError: the algorithm has an attribute that a state cannot hold (kiss: a foreign object).
    """
    label, tree, arrays = _tree_of(slam, beside or {})
    kept, large = dict(arrays), {}
    for name, array in arrays.items():
        if array.nbytes >= MIN_MAPPED_SIZE and array.flags.c_contiguous and not array.dtype.names:
            spans, data = nonzero_spans(array), array.reshape(-1).view(np.uint8)
            large[name] = [array.dtype.str, array.shape, spans]
            kept[name] = np.concatenate([data[:0], *(data[a:b] for a, b in spans)])
    head = STATE_VERSION | {"algorithm": label, "tree": tree, "large": large}
    text = json.dumps(head, separators=(",", ":")).encode()
    write_npz(Path(path), kept | {HEADER_KEY: np.frombuffer(text, np.uint8)}, COMPRESSION_LEVEL)


def save_after(slam: Slam, path: str | Path, t: float, ranges: Ranges, **beside: Any) -> None:
    """As `save`, with the stamp [s] and a hash of the ranges (n,) [m] of the last scan."""
    save(slam, path, {"t": t, "scan": _digest(ranges)} | beside)


def check_target(path: str | Path, slam: Slam) -> None:
    """Check before a run that the algorithm can be saved to the path; raises as `save`."""
    check_file(path)
    _tree_of(slam, {})


def _tree_of(slam: Slam, beside: Mapping[str, Any]) -> tuple[str, Any, Arrays]:
    """Label, tree and arrays of an algorithm for `save`; raises the same TypeError."""
    label, writer = label_of(type(slam)), Writer(type(slam).__module__.partition(".")[0])
    parts = {"params": getattr(slam, "params", None), "slam": slam, "beside": dict(beside)}
    try:
        tree = {name: writer.node(part, name) for name, part in parts.items()}
    except TypeError as error:
        raise TypeError(f"{label} cannot be saved: {error}") from None
    return label, tree, writer.arrays


def load_state(path: str | Path, algorithm: str | None = None) -> Slam:
    """The algorithm that `save` wrote, ready for its next update.

    Args:
        path: the file.
        algorithm: its label, to check it; required if it is a "module:Class".

    Raises:
        OSError: the file cannot be opened.
        ValueError: no state, a damaged one, or one of another algorithm or release.
        LookupError: the algorithm is not installed here.
    """
    return read_state(path, algorithm).slam


def read_state(path: str | Path, algorithm: str | None = None, own: str = "") -> State:
    """As `load_state`, with the values saved beside; `own`: a "module:Class" that may be loaded."""
    path = Path(path)
    label, tree, arrays = _read(path)
    is_foreign = not isinstance(label, str) or (":" in label and label != own)
    if algorithm is None and is_foreign:  # code of a user
        raise ValueError(f"{path}: the state of {label!r}; pass algorithm=... to load its code")
    cls = find(algorithm or label).cls
    if label_of(cls) != label:
        raise ValueError(f"{path}: the state of {label}, expected one of {label_of(cls)}")
    reader = Reader(arrays, cls.__module__.partition(".")[0])
    try:
        params = reader.read(tree["params"], "params", cls.Params())
        new = cls(cls.Params() if params is None else params.replace())  # checks the values
        slam = reader.read(tree["slam"], "slam", new)
        return State(slam, reader.read(tree["beside"], "beside", {}))
    except Exception as error:  # a malformed tree may raise anything
        raise ValueError(f"{path}: not a state of {label}: {_sentence(error)}") from error


def _read(path: Path) -> tuple[str, Any, Arrays]:
    """The contents of a file: the algorithm's label, the tree and its arrays.

    Raises:
        OSError: the file cannot be opened.
        ValueError: no state, a damaged one, or one of another release; one sentence.
    """
    with path.open("rb") as file:
        if file.read(2) != b"PK":
            raise ValueError(f"{path}: not a state; expected a file of --save-state")
    arrays = read_npz(path, most=MAX_STATE_SIZE)
    if HEADER_KEY not in arrays:
        raise ValueError(f"{path}: not a state: no {HEADER_KEY}; expected a file of --save-state")
    try:
        head = json.loads(arrays.pop(HEADER_KEY).tobytes())
        for key, expected in STATE_VERSION.items():
            if head.get(key) != expected:
                raise ValueError(
                    f"saved with {key} {head.get(key)}, expected {expected}: a state needs the "
                    "release that saved it; use that release, or map the log again"
                )
        for name, (dtype, shape, spans) in head["large"].items():
            array, at = zeros(tuple(shape), np.dtype(dtype)), 0
            target = array.reshape(-1).view(np.uint8)
            for a, b in spans:  # filled bytes
                target[a:b] = arrays[name][at : at + b - a]
                at += b - a
            arrays[name] = array
        return head["algorithm"], head["tree"], arrays
    except Exception as error:  # a malformed header may raise anything
        raise ValueError(f"{path}: {_sentence(error)}") from error


def _sentence(error: Exception) -> str:
    """The first 200 characters of an error, on one line."""
    text = str(error) if isinstance(error, ValueError) else f"damaged ({error!r})"
    return " ".join(text.split())[:200]


def check_params(path: str | Path, slam: Slam, params: Params, are_given: bool = False) -> None:
    """Refuse what a saved algorithm lacks, of defaults only if they `are_given`: ValueError."""
    saved: Params = getattr(slam, "params", params)
    if (are_given or params != type(params)()) and params != saved:
        name = next(n for n, value in saved.as_dict().items() if value != getattr(params, n))
        raise ValueError(
            f"{path}: saved with {name} {getattr(saved, name)}, got {getattr(params, name)}; "
            "a state keeps its own parameters, omit them"
        )


def rest_of(log: ScanLog, beside: dict[str, Any], every: int = 1) -> tuple[ScanLog, int]:
    """The scans of a log after the last scan of a state, and the number of scans before them.

    A log without that scan, by stamp and ranges, is another drive and is used as a whole. `every`
    is the step from one scan to the next.

    Raises:
        ValueError: no scan is left.
    """
    same = np.flatnonzero(log.t == beside.get("t"))
    found = [int(i) for i in same if _digest(log.ranges[i]) == beside.get("scan")]
    if not found:
        return log, 0
    first = found[-1] + every
    if first >= len(log):
        raise ValueError(f"{log.name}: all its {len(log)} scans are in the state already")
    return log.rows(slice(first, None)), first


def _digest(ranges: Ranges) -> str:
    return hashlib.sha256(np.ascontiguousarray(ranges).tobytes()).hexdigest()
