"""The user's options for reading a recorded file, and the error for a damaged one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


def _option(default: Any = None, **settings: Any) -> Any:
    """A field that is set by the command line option of the same name, with argparse's settings."""
    return field(default=default, metadata=settings)


@dataclass(frozen=True)
class SourceOptions:
    """What to read from a recorded file; None: decided by the file's content.

    `scan_topic` names the laser (a topic, or a CARMEN message such as RLASER), `more_scan_topics`
    further lasers of a bag, `odom` an odometry topic or tf frame, `imu` a topic, `truth` a
    trajectory file, a topic or a tf frame; "none" uses none. `base_frame` is the robot's tf frame,
    whose poses are computed. `salvage` reads the undamaged part of a damaged file.
    """

    scan_topic: str | None = _option(
        metavar="TOPIC",
        action="append",
        help="topic of the scans, or CARMEN message; give it once for each laser of a bag",
    )
    more_scan_topics: tuple[str, ...] = ()
    odom: str | None = _option(metavar="NAME", help="topic or tf frame of the odometry, or none")
    imu: str | None = _option(metavar="TOPIC", help="topic of the gyro, or none")
    truth: str | None = _option(
        metavar="NAME", help="true poses: a TUM file, a topic, a tf frame, or none"
    )
    base_frame: str | None = _option(
        metavar="FRAME", help="tf frame of the robot, whose poses are computed"
    )
    salvage: bool = _option(
        False, action="store_true", help="read the undamaged part of a damaged log"
    )


class DamagedError(ValueError):
    """The file is cut short or corrupt; its undamaged part can perhaps be salvaged."""


@contextmanager
def name_in_errors(paths: Sequence[Path]) -> Iterator[None]:
    """Puts the name of the first file in front of errors while the files of a log are read."""
    try:
        yield
    except ValueError as error:
        has_name = str(error).startswith(tuple(map(str, paths)))
        if has_name or type(error) not in (ValueError, DamagedError):
            raise
        raise type(error)(f"{paths[0]}: {error}") from error
