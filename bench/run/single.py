"""Parameters of single algorithms: --params and --set with a name, and variants.

A variant is an algorithm with its own settings, NAME:KEY=VALUE[,KEY=VALUE]. The "=" after the last
colon distinguishes it from module:Class. Imports stay fast for --help.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

from slams import cli

if TYPE_CHECKING:
    from slams.params import Params


LABEL_WORDS = "name, name@preset, module:Class, or a variant NAME:KEY=VALUE,..."


@dataclass
class Single:
    """The settings of one algorithm: common values, YAML files, its own values.

    `base` are the parameters from ROS files, preset and sensor.
    """

    common: Mapping[str, str] = field(default_factory=dict)
    base: Params | None = None
    files: list[str] = field(default_factory=list)
    values: dict[str, str] = field(default_factory=dict)

    def applied(self, params: Params) -> Params:
        """The parameters with these settings; precedence: base < common < files < values.

        Raises:
            LookupError: no such parameter.
            ValueError: a value of the wrong type or out of bounds, an invalid YAML file.
            OSError: a file cannot be read.
        """
        params = (self.base or params).replace(**self.common)
        for path in self.files:
            params = params.with_yaml(path)
        return params.replace(**self.values)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add --params and --set, for `singles`."""
    parser.add_argument(
        "--params",
        metavar="ALGORITHM:FILE.yaml",
        action="append",
        default=[],
        help="file of one algorithm's parameters, lines 'name: value'; may be given again",
    )
    parser.add_argument(
        "--set",
        metavar="ALGORITHM:KEY=VALUE",
        action="append",
        default=[],
        dest="changes",
        help="set one parameter of one algorithm (tsd:cell=0.05), or without the name of all that "
        "have it; may be given again",
    )


def with_presets(names: Iterable[str], presets: Iterable[str]) -> list[str]:
    """The labels of algorithms with each of their presets; "" is the default."""
    from slams.registry import find

    known = {name: find(name).cls.Params.PRESETS for name in names}
    labels = [(name, preset) for preset in presets for name in known]
    return [f"{n}@{p}" if p else n for n, p in labels if not p or p in known[n]]


def algorithm_of(label: str) -> str:
    """The algorithm of a variant; any other label itself."""
    return _split(label)[0]


def settings_of(label: str) -> dict[str, str]:
    """The settings of a variant; none for any other label.

    Raises:
        ValueError: they are not KEY=VALUE[,KEY=VALUE], each KEY once.
    """
    settings = _split(label)[1]
    if not settings:
        return {}
    parts = [part.partition("=") for part in settings.split(",")]
    found = {key.strip(): value.strip() for key, _, value in parts}
    if len(found) < len(parts) or not all(equals for _, equals, _ in parts):
        raise ValueError(
            f"--algorithms: got {label!r}, expected NAME:KEY=VALUE[,KEY=VALUE], each KEY once"
        )
    return found


def variant(label: str, /, **settings: str) -> str:
    """The label of an algorithm, or of a variant, with more settings."""
    known = settings_of(label) | settings
    return f"{algorithm_of(label)}:{','.join(f'{key}={value}' for key, value in known.items())}"


def params_of(
    label: str, sensor: str | None = None, given: Mapping[str, Single] = MappingProxyType({})
) -> Params:
    """The parameters of a label; precedence: preset < sensor < `given` < the variant's own.

    Raises:
        LookupError: no such algorithm, sensor or parameter.
        ValueError, OSError: see `Single.applied`.
    """
    from slams.registry import find

    params = find(algorithm_of(label)).params()
    params = params if sensor is None else params.for_sensor(sensor)
    return given.get(label, Single()).applied(params).replace(**settings_of(label))


def singles(
    labels: Sequence[str],
    files: Sequence[str],
    values: Sequence[str],
    common: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, Single]:
    """The settings of ALGORITHM:FILE and [ALGORITHM:]KEY=VALUE and the common ones, by label.

    Settings of an algorithm also hold for its variants. A value with a name has precedence.

    Raises:
        ValueError: invalid text, or an algorithm that is not compared.
        LookupError: a parameter that no algorithm has.
    """
    rows: dict[str, list[str]] = {}
    for label in labels:
        rows.setdefault(algorithm_of(label), []).append(label)
    found = {label: Single(common) for label in labels}
    for text in files:
        name, path = _parted("--params", text, "FILE", rows)
        for label in rows[name]:
            found[label].files.append(path)
    for text in sorted(values, key=_has_name):
        names, assignment = _assigned(text, rows)
        key, value = cli.assignment(assignment)
        for label in (label for name in names for label in rows[name]):
            found[label].values[key] = value
    return found


def seeds(texts: Sequence[str]) -> tuple[dict[str, str], list[str]]:
    """The common setting of the last `--seed N`, and the settings of each ALGORITHM:N."""
    common = [text for text in texts if ":" not in text]
    parted = (text.rpartition(":") for text in texts if ":" in text)
    return {"seed": common[-1]} if common else {}, [f"{n}:seed={seed}" for n, _, seed in parted]


def named(option: str, text: str, form: str) -> tuple[str, str]:
    """Name and file of an option NAME=FILE.

    Raises:
        ValueError: one of them is missing.
    """
    name, _, path = text.partition("=")
    if not name or not path:
        raise ValueError(f"{option}: got {text!r}, expected {form}")
    return name, path


def _split(label: str) -> tuple[str, str]:
    """The algorithm of a label, and the settings of a variant."""
    name, _, settings = label.rpartition(":")
    return (name, settings) if name and "=" in settings else (label, "")


def _has_name(text: str) -> bool:
    """Whether a --set names an algorithm; keys have no colon."""
    key, equals, _ = text.partition("=")
    return ":" in key or not equals


def _assigned(text: str, algorithms: Mapping[str, object]) -> tuple[list[str], str]:
    """The algorithms of a --set, and its KEY=VALUE."""
    if _has_name(text):
        name, assignment = _parted("--set", text, "KEY=VALUE", algorithms)
        return [name], assignment
    key, _ = cli.assignment(text)
    from slams.params import did_you_mean

    known = {name: params_of(name).specs() for name in algorithms}
    having = [name for name, specs in known.items() if key in specs]
    if not having:
        every = {parameter for specs in known.values() for parameter in specs}
        hint = did_you_mean(key, sorted(every))
        raise LookupError(
            f"--set: got {text!r}, expected a parameter of {' or '.join(algorithms)}{hint}"
        )
    return having, text


def _parted(option: str, text: str, form: str, names: Mapping[str, object]) -> tuple[str, str]:
    """Split a text after its algorithm; names such as module:Class contain colons."""
    known = [name for name in names if text.startswith(f"{name}:")]
    if not known:
        raise ValueError(
            f"{option}: got {text!r}, expected ALGORITHM:{form} of one that is compared: "
            f"{', '.join(names)}"
        )
    name = max(known, key=len)
    rest = text[len(name) + 1 :]
    if not rest:
        raise ValueError(f"{option}: got {text!r}, expected ALGORITHM:{form}")
    return name, rest
