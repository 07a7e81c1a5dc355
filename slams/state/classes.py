"""Which classes a state may name: those of the algorithm's own package, and the nouns they share.

A name in a file is looked up, never trusted: a class is only taken where it was defined, and of it
nothing is called but `object.__new__`; a method must be a plain function of such a class.
"""

from __future__ import annotations

import functools
import importlib
import types
from collections.abc import Iterator
from typing import Any, NamedTuple

# what algorithms and `slams.live` keep of ours
SHARED = (
    "types",
    "params",
    "geometry",
    "frontend",
    "grid_bounds",
    "cells",
    "scan",
    "track",
    "refine",
    "localize",
    "heading",
    "live",
    "baselines",
)


class Home(NamedTuple):
    """The package whose classes may be named, beside the shared ones."""

    package: str

    @classmethod
    def of(cls, algorithm: type[Any]) -> Home:
        """The home of an algorithm's class."""
        return cls(algorithm.__module__.partition(".")[0])

    def has(self, kind: type[Any]) -> bool:
        """Whether objects of a class may stand in a state."""
        return self._allows(kind.__module__)

    def find(self, name: str) -> type[Any]:
        """The class "module:QualName".

        Raises:
            ValueError: there is no such class where a state may have one.
        """
        module_name, _, qualified = name.partition(":")
        found: Any = importlib.import_module(module_name) if self._allows(module_name) else None
        for part in qualified.split("."):
            found = getattr(found, "__dict__", {}).get(part)
        if not isinstance(found, type) or name_of(found) != name:
            raise ValueError(f"there is no class {name!r} for a state of {self.package}")
        return found

    def _allows(self, module: str) -> bool:
        top, _, rest = module.partition(".")
        if top == "slams":
            return rest.partition(".")[0] in SHARED
        return top == self.package


def name_of(kind: type[Any]) -> str:
    """What a class is called in a state."""
    return f"{kind.__module__}:{kind.__qualname__}"


def attributes(thing: Any) -> Iterator[tuple[str, Any]]:
    """An object's attributes, in slots and `__dict__`; what is computed when asked for is not."""
    for kind in type(thing).__mro__:
        slots = kind.__dict__.get("__slots__", ())
        for name in (slots,) if isinstance(slots, str) else slots:
            if name not in ("__dict__", "__weakref__") and hasattr(thing, name):
                yield name, getattr(thing, name)
    for name, value in getattr(thing, "__dict__", {}).items():
        if not isinstance(getattr(type(thing), name, None), functools.cached_property):
            yield name, value


def check_attribute(kind: type[Any], name: str) -> None:
    """Refuse a name that would hide a method or property of the class.

    Raises:
        ValueError: it would.
    """
    known = getattr(kind, name, None)
    hidden = isinstance(known, (types.FunctionType, property, functools.cached_property, type))
    if hidden or name.startswith("__"):
        raise ValueError(f"{name_of(kind)} cannot have an attribute {name!r}")


def method_of(thing: Any, name: str) -> types.MethodType:
    """The method of that name, bound to an object of one of our classes.

    Raises:
        ValueError: there is none.
    """
    function = getattr(type(thing), name, None)
    if not isinstance(function, types.FunctionType) or name.startswith("__"):
        raise ValueError(f"{name_of(type(thing))} has no method {name!r}")
    return types.MethodType(function, thing)
