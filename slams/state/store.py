"""Save an algorithm and read it again."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from slams.registry import find, label_of
from slams.state import archive
from slams.state.classes import Home
from slams.state.graph import Graph, graph_of
from slams.state.likeness import check_likeness
from slams.state.rebuild import rebuild

if TYPE_CHECKING:
    from slams.params import Params
    from slams.types import Slam


class State(NamedTuple):
    """What a file held: the algorithm as it was, its label, and what was kept beside it."""

    slam: Slam
    label: str
    beside: dict[str, Any]


def save(slam: Slam, path: str | Path, beside: Mapping[str, Any] | None = None) -> None:
    """Write all that an algorithm knows to one file, whole or not at all.

    Args:
        slam: any algorithm whose state is made of numbers, arrays, lists and objects of classes of
            its own package.
        path: the file; one that is there is replaced when the new one is whole.
        beside: what the caller wants back with it: numbers, texts, poses, scans.

    Raises:
        OSError: the file cannot be written.
        TypeError: the algorithm keeps something that no state can hold (kiss: a foreign library's).
    """
    import slams

    head = {"algorithm": label_of(type(slam)), "slams": slams.__version__}
    archive.write(Path(path), head, _graph({"slam": slam, "beside": dict(beside or {})}))


def check_saving(slam: Slam) -> None:
    """Find out, without writing anything, whether an algorithm can be saved.

    Raises:
        TypeError: it keeps something that no state can hold.
    """
    _graph({"slam": slam})


def _graph(things: dict[str, Any]) -> Graph:
    cls = type(things["slam"])
    try:
        return graph_of(things, Home.of(cls))
    except TypeError as error:
        raise TypeError(f"{label_of(cls)} cannot be saved: {error}") from None


def load_state(path: str | Path, algorithm: str | None = None) -> Slam:
    """The algorithm that `save` wrote; its next update goes on where it stopped.

    Args:
        path: the file.
        algorithm: its label, if it must be this one; needed for a "module:Class" of one's own.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is no state, damaged, of another algorithm or of a newer version.
        LookupError: the algorithm is not installed here.
    """
    return read_state(path, algorithm).slam


def read_state(path: str | Path, algorithm: str | None = None) -> State:
    """As `load_state`, with the label and what was kept beside the algorithm."""
    path = Path(path)
    stored = archive.read(path)
    label = stored.head.get("algorithm")
    cls = _class_of(path, label, algorithm)
    try:
        slam, beside = _whole(rebuild(*stored[1:], Home.of(cls)), cls)
        check_likeness(slam, cls(_params(slam, cls)))
    except (LookupError, ValueError) as error:
        raise ValueError(f"{path}: not a state of {label}: {error}") from error
    return State(slam, str(label), beside)


def _whole(read: dict[str, Any], cls: type[Slam]) -> tuple[Any, dict[str, Any]]:
    slam, beside = read.get("slam"), read.get("beside")
    if type(slam) is not cls or type(beside) is not dict:
        raise ValueError(f"it holds an object of {type(slam).__name__}")
    return slam, beside


def _params(slam: Any, cls: type[Slam]) -> Params:
    """The parameters that a state was saved with, their values checked again."""
    params = getattr(slam, "params", cls.Params())
    if type(params) is not type(cls.Params()):
        raise ValueError(f"its parameters are of {type(params).__name__}")
    return params.replace()


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
