"""Small YAML files written by people: not nested deeply, without aliases (as in ROS 2)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

MAX_FILE_SIZE = 1 << 18  # bytes; parameter files have a few thousand


class _Loader(yaml.SafeLoader):
    """Refuses aliases: with them a few lines can expand to gigabytes."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Compose the next node and all nodes below it."""
        if self.check_event(yaml.AliasEvent):
            raise ValueError("it has an alias *name; write the value there")
        return super().compose_node(parent, index)


def read_text(path: Path) -> str:
    """The content of a text file of at most `MAX_FILE_SIZE`.

    Raises:
        OSError: the file cannot be read.
        ValueError: the file is larger, or not text.
    """
    with path.open("rb") as file:
        raw = file.read(MAX_FILE_SIZE + 1)
    if len(raw) > MAX_FILE_SIZE:
        raise ValueError(f"{path}: larger than 256 kB; expected a yaml file")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not text; expected a yaml file") from None


def parse(text: str, path: Path) -> Any:
    """The content of a YAML text as plain Python values; `path` is its file, for errors.

    Raises:
        ValueError: it is no YAML, nested too deeply, or has aliases.
    """
    try:
        return yaml.load(text, _Loader)
    except RecursionError:
        raise ValueError(f"{path}: nested too deeply for a yaml file") from None
    except (yaml.YAMLError, TypeError, ValueError) as error:  # ValueError: an invalid date
        reason = " ".join(str(error).split())
        raise ValueError(f"{path}: not a YAML file ({reason})") from error
