"""Launch and parameter files of ROS nodes, for the algorithms of a comparison."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING

from slams.registry import find
from slams.ros import ros_params
from slams.ros.ros_params import record as record

if TYPE_CHECKING:
    from bench.run.cases import Choice
    from slams.ros.ros_params import Taken


def taken(given: list[str], labels: list[str], choice: Choice) -> dict[str, Taken]:
    """What the files of ROS nodes say for each algorithm that has some."""
    files: dict[str, list[str]] = {}
    for text in given:
        label, _, path = text.partition("=")
        if not path:
            raise ValueError(f"--ros-params: got {text!r}, expected ALGORITHM=FILE")
        if label not in labels:
            raise ValueError(
                f"--ros-params: got {label!r}, expected one that is compared: {', '.join(labels)}"
            )
        files.setdefault(label, []).append(path)
    entries = {label: find(label) for label in files}
    return {
        label: ros_params.take(choice.params(entry), files[label], entry.preset)
        for label, entry in entries.items()
    }


def say(ros: Mapping[str, Taken], quiet: bool) -> None:
    """The fate of each parameter in ROS files, on stderr as slams.run says it."""
    if not quiet:
        for label, found in ros.items():
            sys.stderr.write(ros_params.report(found, label))
