"""A graph of objects as a flat list of nodes that JSON can hold, with its arrays apart.

A value is written as it is where JSON has it (None, bool, int, float, str); anything else is a node
and stands as [number]. A node is a list: its kind, then what it is made of. Who refers to the same
object before refers to the same object after.

- What can be changed is made empty first and filled later, so it may refer to what refers to it.
- What cannot (tuples, arrays, methods) comes after the nodes that it is made of.
"""

from __future__ import annotations

import functools
import types
from collections import deque
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.state.classes import Home, attributes, name_of
from slams.state.memory import KINDS, Layout, View, word_of

Node = list[Any]
PLAIN = (type(None), bool, int, float, str)
CHANGING = ("list", "dict", "deque", "object")


class Graph(NamedTuple):
    """What stands for each thing by its name, the nodes, and the memory that their arrays have."""

    roots: dict[str, Any]
    nodes: list[Node]
    spans: list[tuple[int, int]]


def graph_of(things: dict[str, Any], home: Home) -> Graph:
    """Everything that can be reached from some things with names.

    Raises:
        TypeError: something in it that no state can keep; the sentence says what and where.
    """
    walk = _Walk(home)
    roots = {name: walk.value(thing, name) for name, thing in things.items()}
    while walk.open:
        walk.fill(*walk.open.popleft())
    layout = Layout(walk.arrays.values())
    for number, array in walk.arrays.items():
        walk.nodes[number] = ["array", *layout.view(array)]
    return Graph(roots, walk.nodes, layout.spans)


class _Walk:
    """Goes through objects; `open` are those whose insides are still to be looked at."""

    def __init__(self, home: Home) -> None:
        self.home = home
        self.nodes: list[Node] = []
        self.arrays: dict[int, NDArray[Any]] = {}
        self.open: deque[tuple[int, Any, str]] = deque()
        self._known: dict[int, tuple[int, Any]] = {}  # the object too: an id is one while it lives

    def value(self, thing: Any, path: str) -> Any:
        """What stands for a thing: itself, or the number of its node."""
        if type(thing) in PLAIN:
            return thing
        if id(thing) not in self._known:
            self._known[id(thing)] = (self._add(thing, path), thing)
        return [self._known[id(thing)][0]]

    def fill(self, number: int, thing: Any, path: str) -> None:
        """Write the insides of what can be changed."""
        node = self.nodes[number]
        if node[0] == "dict":
            node.append([self._pair(k, v, f"{path}[{k!r}]") for k, v in thing.items()])
        elif node[0] == "object":
            node.append([[k, self.value(v, f"{path}.{k}")] for k, v in attributes(thing)])
        else:
            node.append(self._values(thing, path))

    def _add(self, thing: Any, path: str) -> int:
        node = self._fixed(thing, path)
        if node is None:
            node = self._changing(thing, path)
            self.open.append((len(self.nodes), thing, path))
        elif node[0] == "array":
            self.arrays[len(self.nodes)] = thing
        self.nodes.append(node)
        return len(self.nodes) - 1

    def _changing(self, thing: Any, path: str) -> Node:
        """The beginning of a node that is filled later."""
        kind = type(thing)
        if kind in (list, dict):
            return [kind.__name__]
        if kind is deque:
            return ["deque", thing.maxlen]
        if not self.home.has(kind) or not _is_plain_class(kind):
            raise TypeError(
                f"{path} is of the class {name_of(kind)}, which no state can keep; expected "
                f"numbers, arrays, lists and objects of {self.home.package}'s own classes"
            )
        return ["object", name_of(kind)]

    def _fixed(self, thing: Any, path: str) -> Node | None:
        """The node of what cannot be changed, those it is made of before it."""
        if isinstance(thing, tuple):
            return self._tuple(thing, path)
        if isinstance(thing, np.ndarray):
            return _array(thing, path)
        if isinstance(thing, np.generic) and thing.dtype.kind in KINDS:
            return ["scalar", thing.dtype.str, thing.tobytes().hex()]
        if isinstance(thing, np.random.Generator):
            return _generator(thing, path)
        if isinstance(thing, types.MethodType):
            return ["method", self.value(thing.__self__, f"{path} of"), thing.__name__]
        if type(thing) is functools.partial:
            named = [[k, self.value(v, path)] for k, v in thing.keywords.items()]
            return ["partial", self.value(thing.func, path), self._values(thing.args, path), named]
        if isinstance(thing, Enum) and self.home.has(type(thing)):
            return ["enum", name_of(type(thing)), thing.name]
        return None

    def _tuple(self, thing: tuple[Any, ...], path: str) -> Node:
        kind = type(thing)
        if kind is tuple:
            return ["tuple", self._values(thing, path)]
        if not hasattr(kind, "_fields") or not self.home.has(kind):
            raise TypeError(f"{path} is a tuple of the class {name_of(kind)}; expected our own")
        named = zip(kind._fields, thing, strict=True)
        return ["named", name_of(kind), [self.value(v, f"{path}.{k}") for k, v in named]]

    def _values(self, things: Any, path: str) -> list[Any]:
        return [self.value(thing, f"{path}[{i}]") for i, thing in enumerate(things)]

    def _pair(self, key: Any, value: Any, path: str) -> list[Any]:
        return [self.value(key, f"{path} key"), self.value(value, path)]


def _is_plain_class(kind: type[Any]) -> bool:
    """Whether all that an object of the class knows stands in its attributes."""
    own = [base for base in kind.__mro__ if base.__module__ == "builtins"]
    return own == [object] and not issubclass(kind, Enum)


def _array(array: NDArray[Any], path: str) -> Node:
    if type(array) is not np.ndarray or not word_of(array.dtype):
        raise TypeError(f"{path} is an array of {array.dtype}; a state keeps arrays of numbers")
    return ["array", *View(0, "", [], [], 0, True)]  # its place is known when all have been seen


def _generator(rng: np.random.Generator, path: str) -> Node:
    known = rng.bit_generator.state
    if known["bit_generator"] != "PCG64":
        raise TypeError(f"{path} draws from {known['bit_generator']}; expected numpy's default_rng")
    inner = known["state"]
    return ["rng", inner["state"], inner["inc"], known["has_uint32"], known["uinteger"]]
