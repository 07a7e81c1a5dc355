"""YAML that people write: a few values, not nested deeply, without aliases (ROS 2 takes none)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

MAX_FILE_SIZE = 1 << 18  # bytes; parameter files have a few thousand


class _Loader(yaml.SafeLoader):
    """Stops at an alias, of which a few lines can make gigabytes."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Take the next node and all below it."""
        if self.check_event(yaml.AliasEvent):
            raise ValueError("it has an alias *name; write the value there")
        return super().compose_node(parent, index)


def read_text(path: Path) -> str:
    """A text file of the size that people write.

    Raises:
        OSError: it cannot be read.
        ValueError: it is larger, or not text.
    """
    with path.open("rb") as file:
        raw = file.read(MAX_FILE_SIZE + 1)
    if len(raw) > MAX_FILE_SIZE:
        raise ValueError(f"{path}: larger than 256 kB; expected a file of parameters")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not text; expected a file of parameters") from None


def parse(text: str, path: Path) -> Any:
    """What a YAML text says, as plain Python values; `path` is where it stands.

    Raises:
        ValueError: it is no YAML, nested too deeply, or has aliases.
    """
    try:
        return yaml.load(text, _Loader)
    except RecursionError:
        raise ValueError(f"{path}: nested too deeply for a file of parameters") from None
    except (yaml.YAMLError, TypeError, ValueError) as error:  # also a date that is none
        reason = " ".join(str(error).split())
        raise ValueError(f"{path}: not a YAML file ({reason})") from error
