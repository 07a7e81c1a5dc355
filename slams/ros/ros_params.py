"""Takes over the parameters of a published program from its ROS launch or parameter file.

The algorithm's `Params` defines the mapping: `ros=` at the fields, the rest in `Params.ROS`.
Each parameter of a file is mapped, ignored with a reason, or refused.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from slams.params import Params, RosNames
from slams.ros.launch import NodeParameters, read_node

PLUMBING_PATTERN = re.compile(
    r"(^|_)(frames?|topics?|pub|publish(er)?|tf|freq(uency)?|period|interval|queue|service|debug|"
    r"timing|verbose|sim|use_sim_time|qos)(_|$)"
)
PLUMBING_REASON = "ROS plumbing: topics, frames and rates are the log's"
UNIT_NAMES = {"deg": "degrees", "sin": "the sine", "cell": "cells"}


class Fate(NamedTuple):
    """The result for one ROS parameter: "mapped", "assumed" or "ignored", and how or why."""

    name: str
    value: Any
    fate: str
    text: str


class Taken(NamedTuple):
    """Parameters with the values of files, and the fate of each name in them."""

    params: Params
    fates: list[Fate]
    notes: list[str]
    files: list[str]


def take(params: Params, paths: Iterable[str | Path], preset: str = "default") -> Taken:
    """The parameters with the values of launch or parameter files; a later file has priority.

    Args:
        params: the preset's parameters.
        paths: ROS 1 or ROS 2 parameter YAML, or launch XML.
        preset: "original" also takes over what only the published program has, and the node's own
            defaults for parameters that the files leave out.

    Raises:
        OSError: a file cannot be read.
        ValueError: a file is neither, or a parameter in it is refused, with the reason.
    """
    names = _ros_names(params)
    files = [str(path) for path in paths]
    found = _read_files(files, names, _fields_by_ros_name(params))
    values = {name: value for node in found for name, value in node.values.items()}
    _refuse(values, names)
    mapping = _Mapping(params, names, preset == "original")
    for name, value in values.items():
        mapping.take(name, value)
    for path, node in zip(files, found, strict=True):
        if not node.missing:  # else its values are in another file
            mapping.check_use(path, node.values)
    if preset == "original":
        mapping.assume(names.defaults)
    notes = [note for node in found for note in node.notes]
    changed, fates = mapping.result()
    return Taken(changed, fates, notes, files)


def record(taken: Taken) -> dict[str, Any]:
    """The files' parameters and their fates for JSON, complete enough to write the files again."""
    fates = [fate._asdict() | {"value": str(fate.value)} for fate in taken.fates]
    return {"files": taken.files, "parameters": fates, "notes": taken.notes}


def report(taken: Taken, label: str) -> str:
    """The fates as text for a terminal, mapped parameters first."""
    counts = [(fate, sum(f.fate == fate for f in taken.fates)) for fate in _FATE_ORDER]
    title = ", ".join(f"{n} {fate}" for fate, n in counts if n)
    lines = [f"{_ros_names(taken.params).package} -> {label}: {title or 'nothing'}"]
    for fate in sorted(taken.fates, key=lambda fate: _FATE_ORDER.index(fate.fate)):
        kind = "" if fate.fate == "mapped" else f"{fate.fate}: "
        lines.append(f"  {fate.name} = {fate.value}: {kind}{fate.text}")
    return "\n".join([*lines, *(f"  note: {note}" for note in taken.notes)]) + "\n"


_FATE_ORDER = ("mapped", "assumed", "ignored")


def mapping_table(name: str) -> str:
    """Markdown table of each ROS parameter's field in an algorithm and in its original."""
    from slams.registry import find

    default, original = find(name).params(), find(f"{name}@original").params()
    ros, its = _ros_names(default), _ros_names(original)
    lines = [f"| parameter of {ros.package} | {name} | {name}@original | |", "|---|---|---|---|"]
    for ros_name in _fields_by_ros_name(original):
        unit = f" ({UNIT_NAMES[its.units[ros_name]]})" if ros_name in its.units else ""
        words = (f"{a} is {b}" for a, b in its.words.get(ros_name, {}).items() if b)
        reason = ros.original_only.get(ros_name) or ", ".join(words)
        cells = f"{_field_cell(default, ros_name)} | {_field_cell(original, ros_name)} | {reason}"
        lines.append(f"| `{ros_name}`{unit} | {cells} |")
    for ros_name, (value, reason) in ros.refused.items():
        lines.append(f"| `{ros_name}` | refused, unless {value} | refused | {reason} |")
    for ros_name, reason in ros.ignored.items():
        lines.append(f"| `{ros_name}` | ignored | ignored | {reason} |")
    plumbing = PLUMBING_REASON.partition(": ")[0]
    lines.append(f"| topics, frames, rates | ignored | ignored | {plumbing} |")
    return "\n".join(lines) + "\n"


def _field_cell(params: Params, name: str) -> str:
    """The field of a ROS parameter, with the field's unit if the node uses another one."""
    field = _fields_by_ros_name(params).get(name)
    if field is None:
        return "ignored"
    unit = params.specs()[field].unit
    return f"`{field}`" + (f" ({unit})" if name in _ros_names(params).units and unit != "1" else "")


def _ros_names(params: Params) -> RosNames:
    if params.ROS is None:
        raise ValueError(
            f"{type(params).__name__.removesuffix('Params')} has no original in ROS, and therefore "
            "no ROS parameters"
        )
    return params.ROS


def _fields_by_ros_name(params: Params) -> dict[str, str]:
    """Field by ROS name, in the order of the fields."""
    return {name: field for field, spec in params.specs().items() for name in spec.ros}


def _read_files(
    paths: Sequence[str | Path], names: RosNames, fields: dict[str, str]
) -> list[NodeParameters]:
    known = [*fields, *names.original_only, *names.ignored, *names.refused]
    found = [read_node(path, (names.package, *names.nodes), known) for path in paths]
    given = {Path(path).name for path in paths}
    for path, node in zip(paths, found, strict=True):
        for missing in node.missing:
            if Path(missing).name not in given:
                raise ValueError(f"{path}: it loads {missing}; give that file, too")
    return found


def _refuse(values: dict[str, Any], names: RosNames) -> None:
    wrong = [
        f"{name}: {values[name]} ({reason})"
        for name, (harmless, reason) in names.refused.items()
        if name in values and _text_of(values[name]) != harmless
    ]
    if wrong:
        raise ValueError(f"{names.package}: refused {'; '.join(wrong)}")


def _text_of(value: Any) -> str:
    """A value as text; 1.0 and 1 give the same text, and so do True and "true"."""
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return str(value).lower()


class _Mapping:
    """Collects the changed parameters, name by name."""

    def __init__(self, params: Params, names: RosNames, original: bool) -> None:
        self._params = params
        self._names = names
        self._original = original
        self._fields = _fields_by_ros_name(params)
        self._by_field: dict[str, Fate] = {}
        self._ignored: list[Fate] = []
        self._used_names: set[str] = set()

    def take(self, name: str, value: Any, fate: str = "mapped") -> None:
        """Map one name of the file to its field, or ignore it with a reason.

        Of two names for one field, the one listed last at the field has priority.
        """
        reason = self._reason_to_ignore(name, value)
        if reason:
            self._ignored.append(Fate(name, value, "ignored", reason))
            return
        self._used_names.add(name)
        field = self._fields[name]
        order = self._params.specs()[field].ros
        fates = [Fate(name, value, fate, field)]
        if field in self._by_field:
            fates.append(self._by_field[field])
        *others, best = sorted(fates, key=lambda one: order.index(one.name))
        self._by_field[field] = best
        reason = f"{best.name} has priority"
        self._ignored += [other._replace(fate="ignored", text=reason) for other in others]

    def check_use(self, path: str, names: Iterable[str]) -> None:
        """Refuse a file that changes nothing: it is probably the wrong file."""
        if not self._used_names & set(names):
            found = ", ".join(sorted(names)) or "no parameter"
            package = self._names.package
            raise ValueError(f"{path}: nothing in it is taken over for {package} ({found})")

    def assume(self, defaults: Any) -> None:
        """Take the node's own defaults for fields that the files do not set."""
        for name, value in defaults.items():
            if self._fields[name] not in self._by_field:
                self.take(name, value, "assumed")

    def result(self) -> tuple[Params, list[Fate]]:
        """The parameters (sizes in cells use the new cell size) and the fate of each name."""
        params, cell = self._params, self._names.cell
        for field in sorted(self._by_field, key=lambda field: field != cell):
            name, value, *_ = self._by_field[field]
            try:
                params = params.replace(**{field: self._converted(params, name, value)})
            except ValueError as error:
                raise ValueError(f"{self._names.package}: {name} = {value}: {error}") from error
        specs = params.specs()
        mapped = [
            fate._replace(text=f"{field} = {getattr(params, field)} [{specs[field].unit}]")
            for field, fate in self._by_field.items()
        ]
        return params, mapped + self._ignored

    def _reason_to_ignore(self, name: str, value: Any) -> str:
        names = self._names
        if name in names.original_only and not self._original:
            return names.original_only[name]
        if name in self._fields:
            choice = names.words.get(name, {}).get(_text_of(value), "")
            return "" if choice is not None else "as without it"
        if name in names.ignored:
            return names.ignored[name]
        if name in names.refused:
            return "the same here"
        if PLUMBING_PATTERN.search(name):
            return PLUMBING_REASON
        known = [*self._fields, *names.original_only, *names.ignored]
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.7)
        hint = f"; did you mean {near[0]}?" if near else ""
        return f"not a known parameter of {names.package}{hint}"

    def _converted(self, params: Params, name: str, value: Any) -> Any:
        if isinstance(value, str) and "$(" in value:
            raise ValueError("only roslaunch can evaluate it; write the value")
        words = self._names.words.get(name)
        if words is not None:
            if _text_of(value) not in words:
                raise ValueError(f"expected one of {', '.join(words)}")
            return words[_text_of(value)]
        unit = self._names.units.get(name)
        if unit is None:
            return value
        try:
            number = float(value)
        except (TypeError, ValueError):
            raise ValueError("expected a number") from None
        if unit == "cell":
            return number * getattr(params, self._names.cell, 1.0)
        if unit == "sin":
            return math.asin(min(max(number, -1.0), 1.0))
        return math.radians(number)
