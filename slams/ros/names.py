"""Parameters of ROS files as leaves: a path of names, from the outside in, and a value."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

MOST_VALUES = 10_000
DEEPEST = 50

Leaf = tuple[tuple[str, ...], Any]


def leaves_of(content: dict[Any, Any], path: Path) -> Iterator[Leaf]:
    """Every value with its path of names; "a/b" and "a.b" are paths, too.

    Raises:
        ValueError: there are too many, or they stand too deep.
    """
    count = 0
    stack: list[tuple[tuple[str, ...], Any]] = [((), content)]
    while stack:
        names, value = stack.pop()
        count += 1
        if count > MOST_VALUES or len(names) > DEEPEST:
            raise ValueError(f"{path}: more values than a parameter file ever has")
        if isinstance(value, dict):
            stack.extend(
                ((*names, *parts(str(key))), below) for key, below in reversed(value.items())
            )
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
