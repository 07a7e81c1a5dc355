"""Save an algorithm and read it again."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from slams.registry import find, label_of
from slams.state import archive
from slams.state.tree import Reader, Writer

if TYPE_CHECKING:
    from slams.types import Slam


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
    archive.write(Path(path), *state_of(slam, beside or {}))


def state_of(slam: Slam, beside: Mapping[str, Any]) -> tuple[str, Any, archive.Arrays]:
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
    label, tree, arrays = archive.read(path)
    cls = _class_of(path, label, algorithm)
    reader = Reader(arrays, cls.__module__.partition(".")[0])
    try:
        params = reader.thing(tree["params"], "params", cls.Params())
        new = cls(cls.Params() if params is None else params.replace())  # checks the values, too
        slam = reader.thing(tree["slam"], "slam", new)
        return State(slam, label, reader.thing(tree["beside"], "beside", {}))
    except Exception as error:  # a malformed tree raises what it does
        text = f"{path}: not a state of {label}: {archive.sentence(error)}"
        raise ValueError(text) from error


def _class_of(path: Path, label: Any, wanted: str | None) -> type[Slam]:
    """The class that a file names; one of somebody's module only if the caller names it, too."""
    if wanted is not None:
        cls = find(wanted).cls
        if label_of(cls) != label:
            raise ValueError(f"{path}: the state of {label}, expected one of {label_of(cls)}")
        return cls
    if not isinstance(label, str) or ":" in label:
        raise ValueError(f"{path}: the state of {label!r}; say so (algorithm=...) to load its code")
    return find(label).cls
