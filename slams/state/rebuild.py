"""The objects that the nodes of `slams.state.graph` describe, made without calling any of them."""

from __future__ import annotations

import functools
import types
from collections import deque
from collections.abc import Callable
from enum import Enum
from typing import Any

import numpy as np

from slams.state.classes import Home, check_attribute, method_of
from slams.state.graph import CHANGING, Node
from slams.state.memory import Bytes, View, array_of

# what a file that was changed by hand makes of the reading
WRONG = (AttributeError, ImportError, IndexError, KeyError, OverflowError, TypeError, ValueError)


def rebuild(
    roots: dict[str, Any], nodes: list[Node], pieces: list[Bytes], home: Home
) -> dict[str, Any]:
    """The things that a graph was made of, by their names.

    Raises:
        ValueError: the nodes describe none.
    """
    built: list[Any] = []
    try:
        builder = _Builder(nodes, pieces, home)
        built = builder.built
        builder.make()
        return {name: builder.value(root) for name, root in roots.items()}
    except WRONG as error:
        where = f"node {len(built)}" if len(built) < len(nodes) else "its nodes"
        raise ValueError(f"{where}: {error}") from error


class _Builder:
    def __init__(self, nodes: list[Node], pieces: list[Bytes], home: Home) -> None:
        self.built: list[Any] = [None] * len(nodes)
        self._nodes, self._pieces, self._home = nodes, pieces, home
        self._makers: dict[str, Callable[..., Any]] = {
            "tuple": lambda items: tuple(self._values(items)),
            "named": self._named,
            "array": lambda *view: array_of(View(*view), self._pieces),
            "scalar": lambda kind, data: np.frombuffer(bytes.fromhex(data), _number(kind))[0],
            "rng": _generator,
            "method": lambda owner, name: method_of(self.value(owner), name),
            "partial": self._partial,
            "enum": self._enum,
        }

    def make(self) -> None:
        """Empty what can be changed, whole what cannot, then fill: first objects, for dict keys."""
        changing = [i for i, node in enumerate(self._nodes) if node[0] in CHANGING]
        for i in changing:
            self.built[i] = self._empty(self._nodes[i])
        for i, (kind, *parts) in enumerate(self._nodes):
            if kind not in CHANGING:
                self.built[i] = self._makers[kind](*parts)
        for i in sorted(changing, key=lambda i: self._nodes[i][0] == "dict"):
            self._fill(self.built[i], self._nodes[i])

    def value(self, stored: Any) -> Any:
        """What a stored value stands for."""
        if not isinstance(stored, list):
            return stored
        (number,) = stored
        if not 0 <= number < len(self.built):
            raise IndexError(f"there is no node {number}")
        return self.built[number]

    def _values(self, stored: list[Any]) -> list[Any]:
        return [self.value(item) for item in stored]

    def _empty(self, node: Node) -> Any:
        if node[0] == "object":
            kind = self._home.find(node[1])
            return object.__new__(kind)
        if node[0] == "deque":
            return deque(maxlen=node[1])
        return [] if node[0] == "list" else {}

    def _fill(self, thing: Any, node: Node) -> None:
        inside = node[-1]
        if node[0] == "object":
            for name, stored in inside:
                check_attribute(type(thing), name)
                object.__setattr__(thing, name, self.value(stored))
        elif node[0] == "dict":
            thing.update({self.value(key): self.value(item) for key, item in inside})
        else:
            thing.extend(self._values(inside))

    def _named(self, name: str, items: list[Any]) -> Any:
        kind = self._home.find(name)
        fields: tuple[str, ...] = kind.__dict__["_fields"]
        if not issubclass(kind, tuple) or len(items) != len(fields):
            raise ValueError(f"{name} has {len(fields)} fields, got {len(items)}")
        return tuple.__new__(kind, self._values(items))

    def _partial(self, function: Any, arguments: list[Any], named: list[Any]) -> Any:
        method = self.value(function)
        if not isinstance(method, types.MethodType):
            raise ValueError("a partial of something else than a method")
        keywords = {name: self.value(item) for name, item in named}
        return functools.partial(method, *self._values(arguments), **keywords)

    def _enum(self, name: str, member: str) -> Any:
        kind = self._home.find(name)
        if not issubclass(kind, Enum):
            raise ValueError(f"{name} is no enumeration")
        return kind[member]


def _number(kind: str) -> np.dtype[Any]:
    dtype = np.dtype(kind)
    if dtype.hasobject:
        raise ValueError(f"a number of {kind}")
    return dtype


def _generator(state: int, inc: int, has_uint32: int, uinteger: int) -> np.random.Generator:
    bits = np.random.PCG64(0)
    known = bits.state
    known["state"] = {"state": state, "inc": inc}
    known["has_uint32"], known["uinteger"] = has_uint32, uinteger
    bits.state = known
    return np.random.Generator(bits)
