"""An algorithm as a tree of plain values for JSON, with its arrays apart, by name.

A value of JSON (None, bool, int, float, str) stands for itself. Anything else is a list that begins
with its kind. What is met a second time refers to the first ("same"): what was shared stays so.

One walk over attributes serves all classes, in place of a `state_dict` in each of about sixty. It
takes classes of a fixed list of packages, calls no constructor and imports nothing.
"""

from __future__ import annotations

import functools
import re
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

PLAIN = (type(None), bool, int, float, str)
NUMBERS = "biufc"  # kinds of dtypes: bool, integers, floats, complex
# modules and packages of slams whose classes algorithms are made of, beside their own package
SHARED = re.compile(
    r"slams\.(types|params|geometry|frontend|grid_bounds|cells|scan|track|refine|localize|loops|baselines)\b"
)


def _is_allowed(module: str, package: str) -> bool:
    """Whether classes of a module may stand in a state of an algorithm of a package."""
    own = package != "slams" and module.partition(".")[0] == package
    return own or SHARED.match(module) is not None


def _name_of(kind: type[Any]) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def _attributes(thing: Any) -> dict[str, Any]:
    """An object's attributes by name, without those that cached properties compute anew."""
    kind = type(thing)
    if isinstance(thing, tuple):
        return dict(zip(kind.__dict__["_fields"], thing, strict=True))
    slots = [name for name in getattr(kind, "__slots__", ()) if hasattr(thing, name)]
    own = {name: getattr(thing, name) for name in slots} | getattr(thing, "__dict__", {})
    cached = functools.cached_property
    return {k: v for k, v in own.items() if not isinstance(getattr(kind, k, None), cached)}


class Writer:
    """Makes the tree of things of an algorithm of `package`; `arrays` are theirs by name."""

    def __init__(self, package: str) -> None:
        self.arrays: dict[str, NDArray[Any]] = {}
        self._package = package
        self._names: dict[int, tuple[str, Any]] = {}  # by id, which is its own while it lives

    def node(self, thing: Any, name: str) -> Any:
        """The tree of a thing.

        Raises:
            TypeError: it holds something else than data; the sentence says what and where.
        """
        if type(thing) in PLAIN:
            return thing
        if id(thing) in self._names:
            return ["same", self._names[id(thing)][0]]
        self._names[id(thing)] = name, thing
        if isinstance(thing, np.ndarray):
            if type(thing) is not np.ndarray or thing.dtype.kind not in f"{NUMBERS}V":
                raise TypeError(f"{name} is an array of {thing.dtype}; expected numbers")
            self.arrays[name] = thing
            return ["array", name, thing.flags.writeable]
        if isinstance(thing, np.generic) and thing.dtype.kind in NUMBERS:
            return ["number", thing.dtype.str, thing.tobytes().hex()]
        if isinstance(thing, np.random.Generator):
            return ["random", thing.bit_generator.state]
        if type(thing) in (list, tuple):
            return [type(thing).__name__, self._nodes(thing, name)]
        if type(thing) is dict:
            keys = self._nodes(thing, f"{name}.keys")
            return ["dict", keys, [self.node(v, f"{name}[{k!r}]") for k, v in thing.items()]]
        self._check_class(type(thing), name)
        inside = {key: self.node(v, f"{name}.{key}") for key, v in _attributes(thing).items()}
        return ["object", _name_of(type(thing)), inside]

    def _nodes(self, things: Any, name: str) -> list[Any]:
        return [self.node(thing, f"{name}[{i}]") for i, thing in enumerate(things)]

    def _check_class(self, kind: type[Any], name: str) -> None:
        builtin = [base for base in kind.__mro__[:-1] if base.__module__ == "builtins"]
        is_data = not builtin or hasattr(kind, "_fields")
        if not is_data or not _is_allowed(kind.__module__, self._package):
            raise TypeError(
                f"{name} is of the class {_name_of(kind)}, which a state cannot hold; expected "
                f"numbers, arrays, lists, dicts and objects of classes of {self._package}"
            )


class Reader:
    """Makes the things of a tree again, for an algorithm of `package`, with its arrays by name."""

    def __init__(self, arrays: dict[str, NDArray[Any]], package: str) -> None:
        self._arrays, self._package = arrays, package
        self._made: dict[str, Any] = {}

    def thing(self, node: Any, name: str, new: Any = None) -> Any:
        """What a node stands for.

        Args:
            node: of the tree.
            name: the one that it was written with.
            new: its counterpart in a new algorithm, of the same type; None for any type.

        Raises:
            ValueError: it is of another type. A malformed node raises what Python does.
        """
        made = self._make(node, name, new)
        if made is not None and new is not None and _type_of(made) != _type_of(new):
            raise ValueError(f"{name} is {_type_of(made)}, expected {_type_of(new)}")
        self._made[name] = made
        return made

    def _make(self, node: Any, name: str, new: Any) -> Any:
        match node:
            case ["same", first]:
                return self._made[first]
            case ["array", stored, bool(writeable)]:
                self._arrays[stored].flags.writeable = writeable
                return self._arrays[stored]
            case ["number", dtype, data]:
                return np.frombuffer(bytes.fromhex(data), dtype)[0]
            case ["random", state]:
                rng = np.random.default_rng(0)
                rng.bit_generator.state = state
                return rng
            case ["list" | "tuple" as kind, nodes]:
                things = self._things(nodes, name)
                return things if kind == "list" else tuple(things)
            case ["dict", keys, nodes]:
                known, things = new or {}, self._things(keys, f"{name}.keys")
                pairs = zip(things, nodes, strict=True)
                return {k: self.thing(n, f"{name}[{k!r}]", known.get(k)) for k, n in pairs}
            case ["object", str(kind), inside]:
                return self._object(self._class(kind), inside, name, new)
        if type(node) in PLAIN:
            return node
        raise ValueError(f"{name} is malformed")

    def _things(self, nodes: list[Any], name: str) -> list[Any]:
        return [self.thing(node, f"{name}[{i}]") for i, node in enumerate(nodes)]

    def _object(self, kind: type[Any], inside: dict[str, Any], name: str, new: Any) -> Any:
        known = _attributes(new) if type(new) is kind else {}
        missing = {*known, *getattr(kind, "_fields", ())} - set(inside)
        if missing:
            raise ValueError(f"{name} has no {', '.join(sorted(missing))}")
        is_tuple = issubclass(kind, tuple)
        thing = None if is_tuple else object.__new__(kind)
        self._made[name] = thing  # before its attributes, which may refer to it
        made = {key: self.thing(n, f"{name}.{key}", known.get(key)) for key, n in inside.items()}
        if is_tuple:
            return tuple.__new__(kind, made.values())
        for key, value in made.items():
            object.__setattr__(thing, key, value)
        return thing

    def _class(self, name: str) -> type[Any]:
        """A class by its name, looked up among the modules that the algorithm has loaded."""
        module, _, qualified = name.partition(":")
        found: Any = sys.modules.get(module) if _is_allowed(module, self._package) else None
        for part in qualified.split("."):
            found = getattr(found, "__dict__", {}).get(part)
        if not isinstance(found, type) or _name_of(found) != name:
            raise ValueError(f"there is no class {name!r} for a state of {self._package}")
        return found


def _type_of(thing: Any) -> str:
    """What has to be the same as in a new algorithm; int and float may stand for each other."""
    if isinstance(thing, np.ndarray):
        return f"an array of {thing.dtype} with {thing.ndim} dimensions"
    return "a number" if isinstance(thing, (int, float, np.generic)) else _name_of(type(thing))
