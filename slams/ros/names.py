"""Parameters of ROS files as leaves: a path of names, from the outside in, and a value."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

Leaf = tuple[tuple[str, ...], Any]


def leaves_of(content: dict[Any, Any]) -> Iterator[Leaf]:
    """Every value with its path of names; "a/b" and "a.b" are paths, too."""
    for key, value in content.items():
        names = parts(str(key))
        if isinstance(value, dict):
            yield from (((*names, *below), leaf) for below, leaf in leaves_of(value))
        elif names:
            yield names, value


def parts(name: str) -> tuple[str, ...]:
    """Names from the outside in; "~x" and "~/x" are the node's own x."""
    return tuple(part.lstrip("~") for part in re.split(r"[/.]", name) if part.strip("~"))


def by_name(leaves: list[Leaf], path: Path) -> dict[str, Any]:
    """The values by the last of their names; what is said of all nodes ("**") is overruled.

    Raises:
        ValueError: one name has two values.
    """
    values: dict[str, Any] = {}
    came_from: dict[str, tuple[str, ...]] = {}
    for names, value in leaves:
        name = names[-1]
        before = came_from.get(name, ("**",))
        if before[0] != "**" and values[name] != value:
            both = f"{'/'.join(before)}: {values[name]} and {'/'.join(names)}: {value}"
            raise ValueError(f"{path}: two values of one parameter ({both}); keep one")
        values[name], came_from[name] = value, names
    return values
