"""What a user chooses about a recorded file, and the error that says it is not whole."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class SourceOptions:
    """What to take from a recorded file; None = decided by what is in it.

    `scan_topic` names the laser (a topic, or a CARMEN message such as RLASER), `more_scan_topics`
    those of a bag's further lasers that are used with it, `odom` an odometry topic or TF frame,
    `imu` a topic, `truth` a trajectory file, a topic or a TF frame; "none" does without.
    `base_frame` is the TF frame that poses are of. `salvage` reads what is whole in a damaged file
    instead of refusing it.
    """

    scan_topic: str | None = None
    more_scan_topics: tuple[str, ...] = ()
    odom: str | None = None
    imu: str | None = None
    truth: str | None = None
    base_frame: str | None = None
    salvage: bool = False


class DamagedError(ValueError):
    """The file is cut short or corrupt; what is whole in it can perhaps be salvaged."""


@contextmanager
def named(paths: Sequence[Path]) -> Iterator[None]:
    """While files of one log are read: the sentence of a refusal begins with the name of one."""
    try:
        yield
    except ValueError as error:
        has_name = str(error).startswith(tuple(map(str, paths)))
        if has_name or type(error) not in (ValueError, DamagedError):
            raise
        raise type(error)(f"{paths[0]}: {error}") from error
