"""Parameters with unit, meaning, source and bounds, and presets of their values."""

from __future__ import annotations

import dataclasses
import difflib
import typing
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

UNITS = ("m", "rad", "s", "cell", "1", "m/s", "rad/s", "m/s^2", "rad/s^2", "Hz")
# bounds where none is declared: of counts, of lengths [m] (no laser has more range), of others
MAX_COUNT, MAX_LENGTH, MAX_NUMBER = 1e6, 1e3, 1e9
MAX_SEED = 2.0**64
LASER_MODELS = ("utm30lx", "rplidar-a1", "lds01", "lds02")
BOOL_WORDS = {"true": True, "false": False, "yes": True, "no": False, "1": True, "0": False}
MAX_LASERS = 8  # of one robot, distinguished by their mounts; more mounts are an error


@dataclass(frozen=True)
class Spec:
    """The description of one parameter.

    Attributes:
        unit: one of `UNITS`; "1" for counts, ratios, switches and names.
        meaning: one line for `--show-params` and the README.
        source: paper table or section, "original code", or "ours: reason".
        low: least value allowed.
        high: greatest value allowed; default: `MAX_COUNT` for counts, `MAX_LENGTH` for lengths,
            `MAX_NUMBER` for other numbers.
        choices: the values allowed, for a text parameter.
        ros: names of the same parameter in the original ROS package.
        switch: whether it turns a mechanism on and off; `bench.ablation` measures without it.
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
        """Least and greatest value of a number; undeclared bounds are those of its kind."""
        most = MAX_COUNT if kind is int else MAX_LENGTH if self.unit == "m" else MAX_NUMBER
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
    """Declare one field of a `Params` class: its default and the attributes of its `Spec`."""
    if unit not in UNITS:
        raise ValueError(f"unit {unit!r} is not one of {', '.join(UNITS)}")
    if switch and not isinstance(default, bool):
        raise ValueError(f"switch: got the default {default!r}, expected True or False")
    spec = Spec(unit, meaning, source, low, high, tuple(choices), tuple(ros), switch)
    return dataclasses.field(default=default, metadata={"spec": spec})


@dataclass(frozen=True)
class RosNames:
    """How to read the parameters of the original's ROS node, in addition to the `ros=` names.

    The mappings have ROS names as keys and, except `words` and `defaults`, a sentence as value.

    Attributes:
        package: the ROS package.
        nodes: names of its node: executables, and names in launch files.
        units: ROS names in another unit than the field: "deg", "sin" of an angle, "cell".
        cell: the field with the cell size, for the unit "cell".
        words: ROS values -> values of the field; None leaves the field as it is.
        original_only: names that only the preset `original` uses; the reason.
        ignored: names that change nothing here; the reason.
        refused: names that must keep a value; that value, and what to do instead.
        defaults: default values of the node that differ from those of `original`.
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
    """Base of every algorithm's parameters: checked values, presets, and a table of them.

    A preset maps field names to the values that differ from the defaults. A preset that is another
    program, with parameters of its own, is the class of that program as text, "module:Class". The
    values for a sensor override those of any preset.
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
        high=MAX_SEED,
    )

    def __post_init__(self) -> None:
        kinds = typing.get_type_hints(type(self))
        for field in dataclasses.fields(self):
            value = _checked(field, kinds[field.name], getattr(self, field.name))
            object.__setattr__(self, field.name, value)

    @classmethod
    def specs(cls) -> dict[str, Spec]:
        """The `Spec` of every parameter by name."""
        return {f.name: f.metadata["spec"] for f in dataclasses.fields(cls)}

    @classmethod
    def presets(cls) -> list[str]:
        """Names of the presets; "default" is always one."""
        return ["default", *(name for name in cls.PRESETS if name != "default")]

    def for_sensor(self, name: str) -> Self:
        """A copy with the values for a laser of `LASER_MODELS`.

        Raises:
            LookupError: no such laser.
        """
        known = dict.fromkeys([*LASER_MODELS, *self.SENSORS])
        if name not in known:
            hint = did_you_mean(name.lower(), known)
            raise LookupError(f"unknown sensor {name!r}{hint} (known: {', '.join(known)})")
        return self.replace(**self.SENSORS.get(name, {}))

    def replace(self, **changes: Any) -> Self:
        """A copy with some values changed; text is read as the parameter's type.

        Raises:
            LookupError: there is no such parameter; the message has the nearest name.
            ValueError: the value has the wrong type or is out of bounds.
        """
        known = self.specs()
        for name in changes:
            if name not in known:
                hint = f"{did_you_mean(name, known)} (--show-params lists all)"
                raise LookupError(f"unknown parameter {name!r}{hint}")
        return dataclasses.replace(self, **changes)

    def with_yaml(self, path: str | Path) -> Self:
        """A copy with the values of a YAML file of `name: value` lines.

        Raises:
            OSError: the file cannot be read.
            ValueError: the file is not YAML, not a mapping, or nested too deeply.
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
            rows.append((name, setting_text(value), spec.unit, spec.meaning, spec.source))
        return rows


def setting_text(value: Any) -> str:
    """The value of a parameter as text for --set."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The known name nearest to an unknown one, as the end of a sentence, or an empty text."""
    names = difflib.get_close_matches(name, list(known), n=1, cutoff=0.4)
    return f"; did you mean {names[0]!r}?" if names else ""


def _checked(field: dataclasses.Field[Any], kind: type, value: Any) -> Any:
    """`value` as `kind`, or a ValueError of one sentence."""
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
        value = BOOL_WORDS.get(value.lower(), value)
    is_number = kind in (int, float)  # Python counts True and False as int
    if isinstance(value, bool) if is_number else not isinstance(value, kind):
        raise TypeError
    if kind is int and isinstance(value, float) and not value.is_integer():
        raise ValueError
    return kind(value)
