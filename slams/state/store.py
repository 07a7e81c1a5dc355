"""Save an algorithm, read it again, and go on with it in another run.

The file is an npz of the arrays and, as JSON, what they belong to; the zip has a checksum of each.

- `head`: the format, the release that wrote it, the algorithm, the tree of `slams.state.tree`;
  type, shape and filled bytes of each large array.
- `<attribute>`: an array; of a large one only its filled bytes.
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
    from slams.registry import Entry
    from slams.scanlog import ScanLog
    from slams.types import Ranges, Slam

RELEASE = {"format": "slams-state-3", "slams": __version__}
HEAD = "head"
COMPRESSION_LEVEL = 4  # level 1 makes constant arrays three times as large, 9 takes long
MAX_SIZE = 1 << 33  # bytes of all arrays unpacked: more than any map that fits in memory


class State(NamedTuple):
    """What a file held: the algorithm as it was, its label, and what was kept beside it."""

    slam: Slam
    label: str
    beside: dict[str, Any]


def save(slam: Slam, path: str | Path, beside: Mapping[str, Any] | None = None) -> None:
    """Write an algorithm with its map to one file, whole or not at all.

    Args:
        slam: any algorithm whose attributes are numbers, arrays, lists, dicts and objects of
            classes of its own package.
        path: the file; one that is there is replaced when the new one is whole.
        beside: what the caller wants back with it: numbers, texts, lists.

    Raises:
        OSError: the file cannot be written.
        TypeError: the algorithm keeps something that a state cannot hold (kiss: a foreign library).
    """
    label, tree, arrays = _state_of(slam, beside or {})
    kept, large = dict(arrays), {}
    for name, array in arrays.items():
        if array.nbytes >= MIN_MAPPED_SIZE and array.flags.c_contiguous:
            spans, data = nonzero_spans(array), array.reshape(-1).view(np.uint8)
            large[name] = [array.dtype.str, array.shape, spans]
            kept[name] = np.concatenate([data[:0], *(data[a:b] for a, b in spans)])
    head = RELEASE | {"algorithm": label, "tree": tree, "large": large}
    text = json.dumps(head, separators=(",", ":")).encode()
    write_npz(Path(path), kept | {HEAD: np.frombuffer(text, np.uint8)}, COMPRESSION_LEVEL)


def save_after(slam: Slam, path: str | Path, t: float, ranges: Ranges, **beside: Any) -> None:
    """As `save`, with the last scan, by stamp [s] and ranges (n,) [m], among what is `beside`."""
    save(slam, path, {"t": t, "scan": _digest(ranges)} | beside)


def check_target(path: str | Path, slam: Slam) -> None:
    """Refuse, before any work is done, what cannot be saved, or not there; raises as `save`."""
    check_file(path)
    _state_of(slam, {})


def _state_of(slam: Slam, beside: Mapping[str, Any]) -> tuple[str, Any, Arrays]:
    """What `save` writes: label, tree and arrays; it raises the same TypeError."""
    label, writer = label_of(type(slam)), Writer(type(slam).__module__.partition(".")[0])
    things = {"params": getattr(slam, "params", None), "slam": slam, "beside": dict(beside)}
    try:
        tree = {name: writer.node(thing, name) for name, thing in things.items()}
    except TypeError as error:
        raise TypeError(f"{label} cannot be saved: {error}") from None
    return label, tree, writer.arrays


def load_state(path: str | Path, algorithm: str | None = None) -> Slam:
    """The algorithm that `save` wrote; its next update goes on where it stopped.

    Args:
        path: the file.
        algorithm: its label, if it must be this one; needed for a "module:Class" of one's own.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is no state, damaged, of another algorithm or of another release.
        LookupError: the algorithm is not installed here.
    """
    return read_state(path, algorithm).slam


def read_state(path: str | Path, algorithm: str | None = None) -> State:
    """As `load_state`, with the label and what was kept beside the algorithm."""
    path = Path(path)
    label, tree, arrays = _read(path)
    if algorithm is None and (not isinstance(label, str) or ":" in label):  # somebody's module
        raise ValueError(f"{path}: the state of {label!r}; say so (algorithm=...) to load its code")
    cls = find(algorithm or label).cls
    if label_of(cls) != label:
        raise ValueError(f"{path}: the state of {label}, expected one of {label_of(cls)}")
    reader = Reader(arrays, cls.__module__.partition(".")[0])
    try:
        params = reader.thing(tree["params"], "params", cls.Params())
        new = cls(cls.Params() if params is None else params.replace())  # checks the values, too
        slam = reader.thing(tree["slam"], "slam", new)
        return State(slam, label, reader.thing(tree["beside"], "beside", {}))
    except Exception as error:  # a malformed tree raises what it does
        raise ValueError(f"{path}: not a state of {label}: {_sentence(error)}") from error


def _read(path: Path) -> tuple[str, Any, Arrays]:
    """What a file holds: the algorithm's label, the tree and its arrays.

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
        for key, expected in RELEASE.items():
            if head.get(key) != expected:
                raise ValueError(
                    f"saved with {key} {head.get(key)}, expected {expected}: a state goes on with "
                    "the release that saved it; use that one, or map the log again"
                )
        for name, (dtype, shape, spans) in head["large"].items():
            whole, at = zeros(tuple(shape), np.dtype(dtype)), 0
            target = whole.reshape(-1).view(np.uint8)
            for a, b in spans:  # what of it is filled
                target[a:b] = arrays[name][at : at + b - a]
                at += b - a
            arrays[name] = whole
        return head["algorithm"], head["tree"], arrays
    except Exception as error:  # a malformed head raises what it does
        raise ValueError(f"{path}: {_sentence(error)}") from error


def _sentence(error: Exception) -> str:
    """The start of an error's text, on one line."""
    text = str(error) if isinstance(error, ValueError) else f"damaged ({error!r})"
    return " ".join(text.split())[:200]


def resume(path: str | Path, entry: Entry, params: Params) -> State:
    """The state in a file, for a run that asked for an algorithm and parameters.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is no such state, or the run asked for other parameters than it has.
    """
    state = read_state(path, entry.label)
    saved: Params = getattr(state.slam, "params", params)
    if params not in (entry.params(), saved):
        name = next(n for n, value in saved.as_dict().items() if value != getattr(params, n))
        raise ValueError(
            f"{path}: saved with {name} {getattr(saved, name)}, got {getattr(params, name)}; "
            "a state goes on with its own parameters, leave them away"
        )
    return state


def rest_of(log: ScanLog, beside: dict[str, Any], every: int = 1) -> tuple[ScanLog, int]:
    """What of a log comes after the last scan of a state, and how many scans do not.

    A log that has no such scan, by stamp and ranges, is another drive: all of it is left. `every`
    is the step from one scan to the next.

    Raises:
        ValueError: nothing is left.
    """
    same = np.flatnonzero(log.t == beside.get("t"))
    known = [int(i) for i in same if _digest(log.ranges[i]) == beside.get("scan")]
    if not known:
        return log, 0
    first = known[-1] + every
    if first >= len(log):
        raise ValueError(f"{log.name}: all its {len(log)} scans are in the state already")
    return log.rows(slice(first, None)), first


def _digest(ranges: Ranges) -> str:
    return hashlib.sha256(np.ascontiguousarray(ranges).tobytes()).hexdigest()
