"""Parameters of one ROS node, read from a launch or parameter file without ROS.

Three kinds of files: ROS 1 parameter YAML (flat, or below the node's name), ROS 2 parameter YAML
(`node: ros__parameters:`), and launch XML with `<param>`, `<rosparam>` and `<arg>`. Other files
and programs that it refers to (`<include>`, `$(eval ...)`) are noted, not run.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from slams.formats import yaml_file

MAX_GROUP_DEPTH = 50  # nested groups; launch files have one or two
MAX_SUBSTITUTED_LENGTH = 1 << 20  # characters that substitutions add to a launch file
MAX_NUMBER_LENGTH = 100  # characters
SUBSTITUTION_PATTERN = re.compile(r"\$\((?:arg|var)\s+([^()]*)\)")
ROS2_PARAMETERS_KEY = "ros__parameters"

Leaf = tuple[tuple[str, ...], Any]  # a path of names, outermost first, and a value


@dataclass
class NodeParameters:
    """Values by name, notes for the user, and files that the node loads and the user must give."""

    values: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)


def read_node(path: str | Path, nodes: Iterable[str], known: Iterable[str]) -> NodeParameters:
    """The parameters that a file gives to a node.

    Args:
        path: YAML or launch XML, distinguished by content.
        nodes: possible names of the node: package, executable or node name.
        known: the node's parameters, to recognize it in a file that uses another name.

    Raises:
        OSError: the file cannot be read.
        ValueError: the file is neither, or has no such node, or several.
    """
    path = Path(path)
    if path.suffix == ".py":
        raise ValueError(
            f"{path}: a Python launch file is a program; give the YAML file with its parameters"
        )
    text = yaml_file.read_text(path)
    try:
        if text.lstrip().startswith("<"):
            return _from_launch(text, path, set(nodes))
        return _from_yaml(text, path, set(nodes), set(known))
    except RecursionError:
        raise ValueError(f"{path}: nested too deeply for a parameter file") from None


def _from_yaml(text: str, path: Path, nodes: set[str], known: set[str]) -> NodeParameters:
    content = yaml_file.parse(text, path)
    if not isinstance(content, dict):
        raise ValueError(f"{path}: expected parameters 'name: value', or a launch file")
    leaves = _leaves_of_node(list(leaves_of(content)), path, nodes, known)
    return NodeParameters(by_name(leaves, path))


def _leaves_of_node(leaves: list[Leaf], path: Path, nodes: set[str], known: set[str]) -> list[Leaf]:
    """The leaves below one of the node's names; else the only group with known parameters."""
    named = [leaf for leaf in leaves if nodes & set(leaf[0][:-1])]
    if named:
        return [leaf for leaf in leaves if leaf[0][0] == "**"] + named
    groups: dict[tuple[str, ...], list[Leaf]] = {}
    for names, value in leaves:
        groups.setdefault(_group(names), []).append((names, value))
    fitting = [name for name, group in groups.items() if known & {names[-1] for names, _ in group}]
    if not fitting:
        raise ValueError(f"{path}: no parameter of {', '.join(sorted(nodes))} in it")
    if len(fitting) > 1:
        several = ", ".join("/".join(name) or "no node" for name in fitting)
        raise ValueError(f"{path}: parameters of several nodes ({several}); keep one")
    return groups[fitting[0]]


def _group(names: tuple[str, ...]) -> tuple[str, ...]:
    if ROS2_PARAMETERS_KEY in names:
        return names[: names.index(ROS2_PARAMETERS_KEY)]
    return names[:-1][:1]


def _from_launch(text: str, path: Path, nodes: set[str]) -> NodeParameters:
    launch = _Launch(path, nodes)
    try:
        root = ElementTree.fromstring(text, ElementTree.XMLParser(target=_TreeWithoutEntities()))
    except ElementTree.ParseError as error:
        raise ValueError(f"{path}: not a launch file ({error})") from error
    launch.walk(root, {}, ())
    if len(launch.found) > 1:
        raise ValueError(
            f"{path}: {len(launch.found)} nodes of {', '.join(sorted(nodes))}; keep one"
        )
    if not launch.found:
        others = f"; it starts {', '.join(sorted(launch.others))}" if launch.others else ""
        notes = f" ({'; '.join(launch.notes)})" if launch.notes else ""
        raise ValueError(f"{path}: no node of {', '.join(sorted(nodes))}{others}{notes}")
    names = nodes | {launch.found[0][0]}
    outside = [leaf for leaf in launch.outside if names & set(leaf[0][:-1])]
    inside = by_name(launch.found[0][1], path)
    return NodeParameters(by_name(outside, path) | inside, launch.notes, launch.missing)


class _TreeWithoutEntities(ElementTree.TreeBuilder):
    """Builds the XML tree; refuses entity declarations, which could expand without limit."""

    def doctype(self, *_: object) -> None:
        raise ElementTree.ParseError("a launch file has no <!DOCTYPE ...>")


class _Launch:
    """Collects parameters from a launch file, top to bottom as roslaunch does."""

    def __init__(self, path: Path, nodes: set[str]) -> None:
        self.notes: list[str] = []
        self.found: list[tuple[str, list[Leaf]]] = []
        self.others: set[str] = set()
        self.outside: list[Leaf] = []
        self.missing: list[str] = []
        self._path = path
        self._nodes = nodes
        self._expanded_length = 0

    def walk(self, parent: Element, args: dict[str, str], groups: tuple[str, ...]) -> None:
        """Add the parameters of a `<launch>` or `<group>`; `groups` are the enclosing ones."""
        if len(groups) > MAX_GROUP_DEPTH:
            raise ValueError(f"{self._path}: nested too deeply for a launch file")
        for element in parent:
            if not self._is_enabled(element, args):
                continue
            if element.tag == "arg" and "name" in element.attrib:
                self._argument(element, args)
            elif element.tag == "group":
                namespace = self._expanded(element.get("ns", ""), args)
                self.walk(element, dict(args), (*groups, namespace))
            elif element.tag == "include":
                self.notes.append(f"<include {element.get('file', '')}> is not followed")
            elif element.tag == "node":
                self._node(element, args)
            else:
                outer = names_of("/".join(groups))
                self.outside += [((*outer, *n), v) for n, v in self._leaves(element, args)]

    def _argument(self, element: Element, args: dict[str, str]) -> None:
        text = element.get("value", element.get("default"))
        if text is not None:
            args[element.attrib["name"]] = self._expanded(text, args)

    def _node(self, element: Element, args: dict[str, str]) -> None:
        attributes = (element.get(key, "") for key in ("pkg", "type", "exec"))
        programs = {self._expanded(text, args) for text in attributes}
        if not programs & self._nodes:
            self.others.add(element.get("pkg", "?"))
            return
        leaves = [
            leaf
            for child in element
            if self._is_enabled(child, args)
            for leaf in self._leaves(child, args, inside=True)
        ]
        self.found.append((self._expanded(element.get("name", ""), args), leaves))

    def _leaves(self, element: Element, args: dict[str, str], inside: bool = False) -> list[Leaf]:
        """Leaves of one `<param>` or `<rosparam>`, `inside` the node or around it."""
        if element.tag not in ("param", "rosparam"):
            return []
        if (command := element.get("command", "load")) != "load":
            self.notes.append(f"command {self._expanded(command, args)!r} is not run")
            return []
        if file := element.get("file") or element.get("from"):
            name = self._expanded(file, args)
            if inside:
                self.missing.append(name)
            else:
                self.notes.append(f"{name} is another file; give it, too, if it is needed")
            return []
        if element.tag == "param" and "name" in element.attrib:
            name = self._expanded(element.attrib["name"], args)
            value = self._expanded(element.get("value", ""), args)
            return [(names_of(name), _scalar(value, self._path))]
        if element.tag != "rosparam":
            return []
        content = yaml_file.parse(self._expanded(element.text or "", args), self._path)
        names = names_of(f"{element.get('ns', '')}/{element.get('param', '')}")
        if isinstance(content, dict):
            return [((*names, *leaf), value) for leaf, value in leaves_of(content)]
        return [(names, content)] if names else []

    def _is_enabled(self, element: Element, args: dict[str, str]) -> bool:
        for key, wanted in (("if", True), ("unless", False)):
            if key not in element.attrib:
                continue
            text = self._expanded(element.attrib[key], args).strip().lower()
            if text not in ("true", "false", "1", "0"):
                self.notes.append(f"<{element.tag} {key}={text!r}> is left out: not understood")
                return False
            if (text in ("true", "1")) != wanted:
                return False
        return True

    def _expanded(self, text: str, args: dict[str, str]) -> str:
        """`text` with the known `$(arg x)` and `$(var x)` substituted."""

        def _value(match: re.Match[str]) -> str:
            value = args.get(match[1].strip(), match[0])
            self._expanded_length += len(value)
            if self._expanded_length > MAX_SUBSTITUTED_LENGTH:
                raise ValueError(f"{self._path}: longer than 1 MB with its $(arg ...) substituted")
            return value

        return SUBSTITUTION_PATTERN.sub(_value, text)


def _scalar(text: str, path: Path) -> Any:
    """A value with the type that roslaunch gives it: number, boolean or text."""
    if len(text) > MAX_NUMBER_LENGTH:
        return text
    try:
        value = yaml_file.parse(text, path)
    except ValueError:
        return text
    return value if isinstance(value, int | float | bool) else text


def leaves_of(content: dict[Any, Any]) -> Iterator[Leaf]:
    """Every value with its path of names; keys "a/b" and "a.b" are paths, too."""
    for key, value in content.items():
        names = names_of(str(key))
        if isinstance(value, dict):
            yield from (((*names, *below), leaf) for below, leaf in leaves_of(value))
        elif names:
            yield names, value


def names_of(name: str) -> tuple[str, ...]:
    """The names in a path, outermost first; "~x" and "~/x" are the node's own x."""
    return tuple(part.lstrip("~") for part in re.split(r"[/.]", name) if part.strip("~"))


def by_name(leaves: list[Leaf], path: Path) -> dict[str, Any]:
    """The values by the last name of their paths; a value for all nodes ("**") has less weight.

    Raises:
        ValueError: one name has two values.
    """
    values: dict[str, Any] = {}
    origins: dict[str, tuple[str, ...]] = {}
    for names, value in leaves:
        name = names[-1]
        origin = origins.get(name, ("**",))
        if origin[0] != "**" and values[name] != value:
            both = f"{'/'.join(origin)}: {values[name]} and {'/'.join(names)}: {value}"
            raise ValueError(f"{path}: two values of one parameter ({both}); keep one")
        values[name], origins[name] = value, names
    return values
