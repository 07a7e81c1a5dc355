"""An algorithm as a tree of plain values for JSON, and its arrays by name.

A value of JSON (None, bool, int, float, str) represents itself. Any other object is a list that
begins with its kind. An object that occurs again is a reference to the first ("same").

One walk over attributes replaces a `state_dict` in each of about sixty classes. Classes of a fixed
list of modules are allowed; no constructor is called and nothing is imported.
"""

from __future__ import annotations

import functools
import inspect
import re
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

PLAIN_TYPES = (type(None), bool, int, float, str)
NUMBER_KINDS = "biufc"  # kinds of dtypes: bool, integers, floats, complex
# modules of slams whose classes a state may contain, in addition to the algorithm's package
ALLOWED_MODULES = re.compile(
    r"slams\.(types|params|geometry|frontend|grid_bounds|cells|scan|refine|localize|loops|baselines)\b"
)


def _is_allowed(module: str, package: str) -> bool:
    """Whether a state of an algorithm of a package may contain classes of a module."""
    own = package != "slams" and module.partition(".")[0] == package
    return own or ALLOWED_MODULES.match(module) is not None


def _name_of(kind: type[Any]) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def _attributes(obj: Any) -> dict[str, Any]:
    """An object's attributes by name, without cached properties."""
    kind = type(obj)
    if isinstance(obj, tuple):
        return dict(zip(kind.__dict__["_fields"], obj, strict=True))
    known = [item for base in kind.__mro__ for item in vars(base).items()]
    slots = [
        name for name, item in known if inspect.ismemberdescriptor(item) and hasattr(obj, name)
    ]
    own = {name: getattr(obj, name) for name in slots} | getattr(obj, "__dict__", {})
    cached = functools.cached_property
    return {k: v for k, v in own.items() if not isinstance(getattr(kind, k, None), cached)}


class Writer:
    """Makes the tree of an algorithm of `package`, and collects its `arrays` by name."""

    def __init__(self, package: str) -> None:
        self.arrays: dict[str, NDArray[Any]] = {}
        self._package = package
        self._names: dict[int, tuple[str, Any]] = {}  # by id, unique as the object is kept
        self._views: dict[int, list[NDArray[Any]]] = {}  # by the id of their memory's owner

    def node(self, obj: Any, name: str) -> Any:
        """The tree of an object.

        Raises:
            TypeError: an object in it is no data; the sentence names it and its class.
        """
        if type(obj) in PLAIN_TYPES:
            return obj
        if id(obj) in self._names:
            return ["same", self._names[id(obj)][0]]
        self._names[id(obj)] = name, obj
        if isinstance(obj, np.ndarray):
            if type(obj) is not np.ndarray or obj.dtype.kind not in f"{NUMBER_KINDS}V":
                raise TypeError(f"{name} is an array of {obj.dtype}; expected numbers")
            self._check_memory(obj, name)
            self.arrays[name] = obj
            return ["array", name, obj.flags.writeable]
        if isinstance(obj, np.generic) and obj.dtype.kind in NUMBER_KINDS:
            return ["number", obj.dtype.str, obj.tobytes().hex()]
        if isinstance(obj, np.random.Generator):
            return ["random", obj.bit_generator.state]
        if type(obj) in (list, tuple):
            return [type(obj).__name__, self._nodes(obj, name)]
        if type(obj) is dict:
            keys = self._nodes(obj, f"{name}.keys")
            return ["dict", keys, [self.node(v, f"{name}[{k!r}]") for k, v in obj.items()]]
        self._check_class(type(obj), name)
        inside = {key: self.node(v, f"{name}.{key}") for key, v in _attributes(obj).items()}
        return ["object", _name_of(type(obj)), inside]

    def _nodes(self, objects: Any, name: str) -> list[Any]:
        return [self.node(obj, f"{name}[{i}]") for i, obj in enumerate(objects)]

    def _check_memory(self, one: NDArray[Any], name: str) -> None:
        """Refuse views of one memory of which one can be written: loaded, they were separate."""
        owner = one
        while isinstance(owner.base, np.ndarray):
            owner = owner.base
        views = self._views.setdefault(id(owner), [])
        for other in views:
            if np.may_share_memory(one, other) and (one.flags.writeable or other.flags.writeable):
                raise TypeError(f"{name} is a view of {self._names[id(other)][0]}; copy it")
        views.append(one)

    def _check_class(self, kind: type[Any], name: str) -> None:
        builtin = [base for base in kind.__mro__[:-1] if base.__module__ == "builtins"]
        is_data = not builtin or hasattr(kind, "_fields")
        if not is_data or not _is_allowed(kind.__module__, self._package):
            raise TypeError(
                f"{name} is of the class {_name_of(kind)}, which a state cannot hold; expected "
                f"numbers, arrays, lists, dicts and objects of classes of {self._package}"
            )


class Reader:
    """Makes the objects of a tree, for an algorithm of `package`, with its arrays by name."""

    def __init__(self, arrays: dict[str, NDArray[Any]], package: str) -> None:
        self._arrays, self._package = arrays, package
        self._made: dict[str, Any] = {}

    def read(self, node: Any, name: str, new: Any = None) -> Any:
        """The object of a node.

        Args:
            node: of the tree.
            name: the name with which it was written.
            new: its counterpart in a new algorithm, of the same type; None for any type.

        Raises:
            ValueError: the type differs. A malformed node may raise anything.
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
                objects = self._read_all(nodes, name)
                return objects if kind == "list" else tuple(objects)
            case ["dict", keys, nodes]:
                known, objects = new or {}, self._read_all(keys, f"{name}.keys")
                pairs = zip(objects, nodes, strict=True)
                return {k: self.read(n, f"{name}[{k!r}]", known.get(k)) for k, n in pairs}
            case ["object", str(kind), inside]:
                return self._object(self._class(kind), inside, name, new)
        if type(node) in PLAIN_TYPES:
            return node
        raise ValueError(f"{name} is malformed")

    def _read_all(self, nodes: list[Any], name: str) -> list[Any]:
        return [self.read(node, f"{name}[{i}]") for i, node in enumerate(nodes)]

    def _object(self, kind: type[Any], inside: dict[str, Any], name: str, new: Any) -> Any:
        known = _attributes(new) if type(new) is kind else {}
        missing = {*known, *getattr(kind, "_fields", ())} - set(inside)
        if missing:
            raise ValueError(f"{name} has no {', '.join(sorted(missing))}")
        is_tuple = issubclass(kind, tuple)
        obj = None if is_tuple else object.__new__(kind)
        self._made[name] = obj  # before its attributes: these may refer to the object
        made = {key: self.read(n, f"{name}.{key}", known.get(key)) for key, n in inside.items()}
        if is_tuple:
            return tuple.__new__(kind, made.values())
        for key, value in made.items():
            object.__setattr__(obj, key, value)
        return obj

    def _class(self, name: str) -> type[Any]:
        """A class by its name, from a module that is already loaded."""
        module, _, qualified = name.partition(":")
        found: Any = sys.modules.get(module) if _is_allowed(module, self._package) else None
        for part in qualified.split("."):
            found = getattr(found, "__dict__", {}).get(part)
        if not isinstance(found, type) or _name_of(found) != name:
            raise ValueError(f"there is no class {name!r} for a state of {self._package}")
        return found


def _type_of(obj: Any) -> str:
    """The type to compare with that in a new algorithm; all numbers have one type."""
    if isinstance(obj, np.ndarray):
        return f"an array of {obj.dtype} with {obj.ndim} dimensions"
    return "a number" if isinstance(obj, (int, float, np.generic)) else _name_of(type(obj))
