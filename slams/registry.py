"""Classes of algorithms by name; no algorithm is imported before it is used.

A name is a built-in ("hector"), an entry point of the group `slams.algorithms`, or the path
"module:Class". "name@preset" selects a preset of its `Params.PRESETS`: other values of the
parameters, or another class. The suffix "+loops" adds a pose graph that closes loops.
"""

from __future__ import annotations

import importlib
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, NamedTuple

from slams.params import Params, did_you_mean

if TYPE_CHECKING:
    from slams.types import Slam

ENTRY_POINT_GROUP = "slams.algorithms"
LOOPS_SUFFIX = "+loops"

ALGORITHMS = {  # class, and idea in about five words; details are in the README of the package
    "hector": ("hector.slam:Hector", "gradient matching on grid pyramids"),
    "tsd": ("tsd.slam:Tsd", "registration against signed distance field"),
    "crsm": ("crsm.slam:Crsm", "few critical rays, hill climbing"),
    "gmapping": ("gmapping.slam:GMapping", "particles, each with its map"),
    "odometry": ("slams.baselines:Odometry", "baseline: the wheels alone"),
    "kiss": ("slams.baselines:Kiss", "baseline: laser odometry, voxel map"),
}
BUILT_IN = {name: target for name, (target, _) in ALGORITHMS.items()}
DESCRIPTIONS = {name: idea for name, (_, idea) in ALGORITHMS.items()}

BASELINES = ("odometry", "kiss")


class Entry(NamedTuple):
    """An algorithm to run: its label as given by the user, its class, the name of the preset.

    If the preset is a class of its own, its parameters are the defaults of that class.
    """

    label: str
    cls: type[Slam]
    preset: str

    def params(self) -> Params:
        """The preset's parameters."""
        changes = self.cls.Params.PRESETS.get(self.preset, {})
        return self.cls.Params().replace(**({} if isinstance(changes, str) else changes))


def names() -> list[str]:
    """Every registered name, built-ins first."""
    plugins = sorted(point.name for point in entry_points(group=ENTRY_POINT_GROUP))
    return [*BUILT_IN, *(name for name in plugins if name not in BUILT_IN)]


def find(label: str) -> Entry:
    """Resolve "name", "name@preset" or "module:Class[@preset]", each with "+loops" or without.

    Raises:
        LookupError: no such name, module, class or preset.
        TypeError: the object is not a Slam, or it lacks the hooks that loops need.
    """
    if LOOPS_SUFFIX in label:
        entry = find(label.replace(LOOPS_SUFFIX, "", 1))
        looped = importlib.import_module("slams.loops").looped
        return Entry(label, looped(entry.cls), entry.preset)
    name, _, preset = label.partition("@")
    cls, preset = _slam_class(name, _target(name)), preset or "default"
    known = cls.Params.presets()
    if preset not in known:
        raise LookupError(f"{name} has no preset {preset!r}; expected one of {', '.join(known)}")
    own = cls.Params.PRESETS.get(preset)
    return Entry(label, _slam_class(label, own) if isinstance(own, str) else cls, preset)


def create(label: str, **changes: Any) -> Slam:
    """An instance of the algorithm named `label`, with some parameters changed."""
    entry = find(label)
    return entry.cls(entry.params().replace(**changes))


def label_of(cls: type[Any]) -> str:
    """The label by which `find` returns a class: name, "name@preset" or "module:Class"."""
    if hasattr(cls, "algorithm"):  # with loops
        return label_of(cls.algorithm) + LOOPS_SUFFIX
    package = cls.__module__.partition(".")[0]
    for name in names():
        if _target(name).partition(".")[0] == package:
            presets = find(name).cls.Params.presets()
            for label in (name, *(f"{name}@{preset}" for preset in presets)):
                if find(label).cls is cls:
                    return label
    return f"{cls.__module__}:{cls.__qualname__}"


def _target(name: str) -> str:
    if name in BUILT_IN:
        return BUILT_IN[name]
    if ":" in name:
        return name
    for point in entry_points(group=ENTRY_POINT_GROUP):
        if point.name == name:
            return point.value
    known = f"(known: {', '.join(names())}, or module:Class)"
    raise LookupError(f"unknown algorithm {name!r}{did_you_mean(name, names())} {known}")


def _slam_class(name: str, target: str) -> type[Slam]:
    module_name, _, attribute = target.partition(":")
    try:
        found = getattr(importlib.import_module(module_name), attribute)
    except ModuleNotFoundError as error:
        if error.name is None or not (module_name + ".").startswith(error.name + "."):
            raise
        raise LookupError(f"algorithm {name!r}: there is no module {module_name!r}") from None
    except (AttributeError, ValueError):
        raise LookupError(
            f"algorithm {name!r}: there is no {attribute!r} in {module_name!r}"
        ) from None
    needed = ("Params", "update", "map", "report")
    missing = [item for item in needed if not hasattr(found, item)]
    if not isinstance(found, type) or missing:
        raise TypeError(
            f"{target} is not a SLAM algorithm: expected a class with {', '.join(needed)}"
            + (f"; {', '.join(missing)} missing" if missing else "")
        )
    params = getattr(found, "Params", None)
    if not (isinstance(params, type) and issubclass(params, Params)):
        raise TypeError(
            f"{target}: its Params is {params!r}, expected slams.Params or a class derived from it"
        )
    return found
