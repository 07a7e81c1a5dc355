"""Parameters with unit, meaning, source and bounds, and the presets made of them."""

from __future__ import annotations

import dataclasses
import difflib
import typing
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

UNITS = ("m", "rad", "s", "cell", "1", "m/s", "rad/s", "m/s^2", "rad/s^2", "Hz")
# where nothing else is declared: of a count, of a length (no laser sees farther), of other numbers
MOST, FARTHEST, GREATEST = 1e6, 1e3, 1e9
SEEDS = 2.0**64
LASERS = ("utm30lx", "rplidar-a1", "lds01", "lds02")
WORDS = {"true": True, "false": False, "yes": True, "no": False, "1": True, "0": False}
MAX_LASERS = 8  # of one robot, distinguished by mount; more are a mistake


@dataclass(frozen=True)
class Spec:
    """What is known of one parameter beside its value.

    Attributes:
        unit: one of `UNITS`; "1" for counts, ratios, switches and names.
        meaning: one line for `--show-params` and the README.
        source: paper table or section, "original code", or "ours: reason".
        low: least value allowed.
        high: greatest value allowed; without it `MOST` for counts, `FARTHEST` for lengths,
            `GREATEST` for other numbers.
        choices: the words allowed, for a text parameter.
        ros: names of the same parameter in the original ROS package.
        switch: whether it turns a mechanism on and off: what `bench.ablation` tries without.
    """

    unit: str
    meaning: str
    source: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    ros: tuple[str, ...] = ()
    switch: bool = False

    def bounds(self, kind: type) -> tuple[float, float]:
        """Least and greatest value of a number; not declared: what any run could still hold."""
        most = MOST if kind is int else FARTHEST if self.unit == "m" else GREATEST
        return -most if self.low is None else self.low, most if self.high is None else self.high


def param(
    default: Any,
    unit: str,
    meaning: str,
    *,
    source: str,
    low: float | None = None,
    high: float | None = None,
    choices: Sequence[str] = (),
    ros: Sequence[str] = (),
    switch: bool = False,
) -> Any:
    """Declare one field of a `Params` class: its default, and as in `Spec` what is known of it."""
    if unit not in UNITS:
        raise ValueError(f"unit {unit!r} is not one of {', '.join(UNITS)}")
    if switch and not isinstance(default, bool):
        raise ValueError(f"switch: got the default {default!r}, expected True or False")
    spec = Spec(unit, meaning, source, low, high, tuple(choices), tuple(ros), switch)
    return dataclasses.field(default=default, metadata={"spec": spec})


@dataclass(frozen=True)
class RosNames:
    """What the parameters of the original's ROS node mean here, beside the fields' `ros=` names.

    Every mapping but `words` and `defaults` has ROS names as keys and one sentence as value.

    Attributes:
        package: the ROS package.
        nodes: names its node goes by: executables and what launch files call them.
        units: ROS names in another unit than the field: "deg", "sin" of an angle, "cell".
        cell: the field with the edge of a cell, for the unit "cell".
        words: ROS values -> values of the field; None leaves the field as it is.
        original_only: names only the preset `original` takes; why this class does not.
        ignored: names that change nothing here, and why.
        refused: names that must keep a value, that value, and what to do instead.
        defaults: values the node has for names that nobody sets, where `original` has others.
    """

    package: str
    nodes: tuple[str, ...]
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
    cell: str = "cell"
    words: Mapping[str, Mapping[str, Any]] = dataclasses.field(default_factory=dict)
    original_only: Mapping[str, str] = dataclasses.field(default_factory=dict)
    ignored: Mapping[str, str] = dataclasses.field(default_factory=dict)
    refused: Mapping[str, tuple[str, str]] = dataclasses.field(default_factory=dict)
    defaults: Mapping[str, Any] = dataclasses.field(default_factory=dict)


@dataclass(frozen=True)
class Params:
    """Base of every algorithm's parameters: checks values, knows presets, prints its table.

    A preset is a mapping of field names to the values that differ from the defaults, or, where it
    is another program with parameters of its own, that program's class as text, "module:Class". A
    sensor's values go on top of any preset.
    """

    PRESETS: ClassVar[Mapping[str, Mapping[str, Any] | str]] = {}
    SENSORS: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    ROS: ClassVar[RosNames | None] = None

    seed: int = param(
        0,
        "1",
        "seed of every random draw",
        source="ours: same input, same output",
        low=0,
        high=SEEDS,
    )

    def __post_init__(self) -> None:
        kinds = typing.get_type_hints(type(self))
        for field in dataclasses.fields(self):
            value = _checked(field, kinds[field.name], getattr(self, field.name))
            object.__setattr__(self, field.name, value)

    @classmethod
    def specs(cls) -> dict[str, Spec]:
        """Every parameter's name with its unit, meaning, source and bounds."""
        return {f.name: f.metadata["spec"] for f in dataclasses.fields(cls)}

    @classmethod
    def presets(cls) -> list[str]:
        """Names of the presets; "default" is always one."""
        return ["default", *(name for name in cls.PRESETS if name != "default")]

    @classmethod
    def preset(cls, name: str = "default") -> Self:
        """The parameters of a preset that is one of this class.

        Raises:
            LookupError: there is no preset of that name, or it is a class of its own, which
                `slams.find("name@preset")` has.
        """
        if name != "default" and name not in cls.PRESETS:
            raise LookupError(
                f"unknown preset {name!r}; expected one of {', '.join(cls.presets())}"
            )
        changes = cls.PRESETS.get(name, {})
        if isinstance(changes, str):
            raise LookupError(
                f"preset {name!r} is a class of its own, {changes}; "
                f"slams.find('NAME@{name}') has its parameters"
            )
        return cls().replace(**changes)

    def for_sensor(self, name: str) -> Self:
        """A copy with what has to change for a laser of `LASERS`.

        Raises:
            LookupError: no such laser.
        """
        known = dict.fromkeys([*LASERS, *self.SENSORS])
        if name not in known:
            hint = nearest(name.lower(), known)
            raise LookupError(f"unknown sensor {name!r}{hint} (known: {', '.join(known)})")
        return self.replace(**self.SENSORS.get(name, {}))

    def replace(self, **changes: Any) -> Self:
        """A copy with some values changed; text is read as the parameter's type.

        Raises:
            LookupError: no such parameter (the nearest name is given).
            ValueError: the value has the wrong type or is out of bounds.
        """
        known = self.specs()
        for name in changes:
            if name not in known:
                hint = f"{nearest(name, known)} (--show-params lists all)"
                raise LookupError(f"unknown parameter {name!r}{hint}")
        return dataclasses.replace(self, **changes)

    def with_yaml(self, path: str | Path) -> Self:
        """A copy with the values of a YAML file of `name: value` lines.

        Raises:
            OSError: the file cannot be read.
            ValueError: it is not YAML, not a mapping, or nested too deeply.
        """
        from slams.formats import yaml_file

        values = yaml_file.parse(yaml_file.read_text(Path(path)), Path(path))
        if values is None:
            return self
        if not isinstance(values, dict) or not all(isinstance(k, str) for k in values):
            raise ValueError(f"{path}: expected lines 'name: value', got {type(values).__name__}")
        return self.replace(**values)

    def as_dict(self) -> dict[str, Any]:
        """All values by name, ready for JSON or YAML."""
        return dataclasses.asdict(self)

    def table(self) -> list[tuple[str, str, str, str, str]]:
        """Rows (name, value, unit, meaning, source), in the order of the fields."""
        rows = []
        for name, spec in self.specs().items():
            value = getattr(self, name)
            rows.append((name, worded(value), spec.unit, spec.meaning, spec.source))
        return rows


def worded(value: Any) -> str:
    """A parameter's value as --set takes it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def nearest(name: str, known: Iterable[str]) -> str:
    """The known name that a wrong one may stand for, as the end of a sentence, or nothing."""
    near = difflib.get_close_matches(name, list(known), n=1, cutoff=0.4)
    return f"; did you mean {near[0]!r}?" if near else ""


def _checked(field: dataclasses.Field[Any], kind: type, value: Any) -> Any:
    """`value` as `kind`, or one clear sentence."""
    spec: Spec = field.metadata["spec"]
    try:
        value = _converted(kind, value)
    except (TypeError, ValueError):
        expected = f"{kind.__name__} [{spec.unit}]"
    else:
        low, high = spec.bounds(kind)
        if spec.choices and value not in spec.choices:
            expected = f"one of {', '.join(spec.choices)}"
        elif kind is not str and not low <= value <= high:
            expected = f"{low:g} to {high:g} [{spec.unit}]"
        else:
            return value
    raise ValueError(f"parameter {field.name!r}: got {value!r}, expected {expected}")


def _converted(kind: type, value: Any) -> Any:
    if kind is bool and isinstance(value, str):
        value = WORDS.get(value.lower(), value)
    counts = kind in (int, float)  # True and False are ints to Python, and none of these
    if isinstance(value, bool) if counts else not isinstance(value, kind):
        raise TypeError
    if kind is int and isinstance(value, float) and not value.is_integer():
        raise ValueError
    return kind(value)
