"""YAML that people write: a few values. Aliases that would make many of them are not followed."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

LARGEST = 1 << 18  # bytes
MOST_TEXT = 1 << 20  # characters, with every alias written out
DEEPEST = 50
BRACKETS = re.compile(r"[\[{\]}]")
COMMENT = re.compile(r"#.*")


class _Loader(yaml.SafeLoader):
    """Stops at the first value that stands too deep."""

    depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Take the next node and all below it."""
        self.depth += 1
        if self.depth > DEEPEST:
            raise RecursionError
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


def read_text(path: Path) -> str:
    """A text file of the size that people write.

    Raises:
        OSError: it cannot be read.
        ValueError: it is larger, or not text.
    """
    with path.open("rb") as file:
        raw = file.read(LARGEST + 1)
    if len(raw) > LARGEST:
        raise ValueError(f"{path}: larger than 256 kB; expected a file of parameters")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not text; expected a file of parameters") from None


def parse(text: str, path: Path) -> Any:
    """What a YAML text says, as plain Python values; `path` is where it stands.

    Raises:
        ValueError: it is no YAML, nested too deeply, or grows too much by its aliases.
    """
    try:
        return _constructed(text)
    except RecursionError:
        raise ValueError(f"{path}: nested too deeply for a file of parameters") from None
    except (yaml.YAMLError, TypeError, ValueError) as error:  # also a date that is none
        reason = " ".join(str(error).split())
        raise ValueError(f"{path}: not a YAML file ({reason})") from error


def _constructed(text: str) -> Any:
    if _nesting(text) > DEEPEST:  # the library looks far ahead in these
        raise RecursionError
    loader = _Loader(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        if _written_out(node, {}) > MOST_TEXT:
            raise ValueError("its aliases make more values than a person writes")
        return loader.construct_document(node)
    finally:
        loader.dispose()


def _nesting(text: str) -> int:
    """How deep brackets stand in each other; those in comments are units and intervals."""
    depth = deepest = 0
    for bracket in BRACKETS.findall(COMMENT.sub("", text)):
        depth = max(0, depth + (1 if bracket in "[{" else -1))
        deepest = max(deepest, depth)
    return deepest


def _written_out(node: yaml.Node, known: dict[int, int]) -> int:
    """Characters of a node if every alias below it were written out; a value has at least one."""
    if id(node) in known:
        if not known[id(node)]:
            raise ValueError("an alias stands in its own value")
        return known[id(node)]
    known[id(node)] = 0  # begun
    size = 1 if not isinstance(node, yaml.ScalarNode) else 1 + len(node.value)
    for below in _below(node):
        size += _written_out(below, known)
    known[id(node)] = size
    return size


def _below(node: yaml.Node) -> list[yaml.Node]:
    if isinstance(node, yaml.MappingNode):
        return [part for pair in node.value for part in pair]
    return list(node.value) if isinstance(node, yaml.SequenceNode) else []
