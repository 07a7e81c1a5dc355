"""Parameters for single algorithms of a comparison: --params, --set and --seed with a name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from slams import cli

if TYPE_CHECKING:
    from slams.params import Params


@dataclass
class Single:
    """What one algorithm alone is given: YAML files, values by name, a seed."""

    files: list[str] = field(default_factory=list)
    values: dict[str, str] = field(default_factory=dict)

    def applied(self, params: Params) -> Params:
        """The parameters with them: files < values.

        Raises:
            LookupError: no such parameter.
            ValueError: a value of the wrong type or out of bounds, a file that is no YAML.
            OSError: a file cannot be read.
        """
        for path in self.files:
            params = params.with_yaml(path)
        return params.replace(**self.values)


def singles(
    labels: Sequence[str], files: Sequence[str], values: Sequence[str], seeds: Sequence[str]
) -> dict[str, Single]:
    """What ALGORITHM:FILE, ALGORITHM:KEY=VALUE and ALGORITHM:SEED say, by algorithm.

    Raises:
        ValueError: a text of another form, or of an algorithm that is not compared.
    """
    found: dict[str, Single] = {}
    for text in files:
        label, path = _parted("--params", text, "FILE", labels)
        found.setdefault(label, Single()).files.append(path)
    for text in values:
        label, assignment = _parted("--set", text, "KEY=VALUE", labels)
        key, value = cli.assignment(assignment)
        found.setdefault(label, Single()).values[key] = value
    for text in seeds:
        label, seed = _parted("--seed", text, "N", labels)
        found.setdefault(label, Single()).values["seed"] = seed
    return found


def common_seed(seeds: Sequence[str]) -> tuple[int | None, list[str]]:
    """The last seed that is for all (None without), and those for single algorithms.

    Raises:
        ValueError: neither a number nor of the form ALGORITHM:N.
    """
    common, named = None, []
    for text in seeds:
        if ":" in text:
            named.append(text)
        else:
            common = _number(text)
    return common, named


def _number(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"--seed: got {text!r}, expected a number, or ALGORITHM:N") from None


def _parted(option: str, text: str, form: str, labels: Sequence[str]) -> tuple[str, str]:
    """Label and rest; labels such as module:Class have colons of their own."""
    known = [label for label in labels if text.startswith(f"{label}:")]
    if not known:
        raise ValueError(
            f"{option}: got {text!r}, expected ALGORITHM:{form} of one that is compared: "
            f"{', '.join(labels)}"
        )
    label = max(known, key=len)
    rest = text[len(label) + 1 :]
    if not rest:
        raise ValueError(f"{option}: got {text!r}, expected ALGORITHM:{form}")
    return label, rest
