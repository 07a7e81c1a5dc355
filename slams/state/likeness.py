"""Is what was read what this release's algorithm is made of? Compared with one newly made."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from slams.state.classes import attributes, name_of


def check_likeness(read: Any, new: Any) -> None:
    """Compare a state with a new instance: classes, attributes, types and dimensions of arrays.

    Lists may have grown, and what a new instance has not got yet (None) may be anything.

    Raises:
        ValueError: something is of another kind; the sentence says what.
    """
    seen: set[tuple[int, int]] = set()
    open_ = [("slam", read, new)]
    while open_:
        path, old, fresh = open_.pop()
        if old is None or fresh is None or (id(old), id(fresh)) in seen:
            continue
        seen.add((id(old), id(fresh)))
        _check_kind(path, old, fresh)
        open_.extend(_inside(path, old, fresh))


def _check_kind(path: str, old: Any, fresh: Any) -> None:
    got, expected = _kind(old), _kind(fresh)
    if got != expected:
        raise ValueError(f"{path} is {got}, expected {expected}: saved by another release?")


def _kind(thing: Any) -> str:
    """What has to be the same; whole and broken numbers may stand for each other."""
    if isinstance(thing, np.ndarray):
        frozen = "" if thing.flags.writeable else "read-only "
        return f"a {frozen}{thing.dtype} array of {thing.ndim} dimensions"
    if isinstance(thing, (int, float, np.generic)):
        return "a number"
    return f"of {name_of(type(thing))}"


def _inside(path: str, old: Any, fresh: Any) -> Iterator[tuple[str, Any, Any]]:
    if isinstance(fresh, dict):
        yield from ((f"{path}[{k!r}]", old[k], fresh[k]) for k in fresh if k in old)
    elif isinstance(fresh, (list, tuple)):
        pairs = enumerate(zip(old, fresh, strict=False))
        yield from ((f"{path}[{i}]", a, b) for i, (a, b) in pairs)
    else:
        has, known = dict(attributes(old)), dict(attributes(fresh))
        missing = [name for name in known if name not in has]
        if missing:
            raise ValueError(f"{path} has no {', '.join(missing)}: saved by another release?")
        yield from ((f"{path}.{name}", has[name], known[name]) for name in known)
