"""ROS bags: a ScanLog or one track from a whole bag, or from what is whole in a damaged one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TypeVar

from slams.formats.bag import Topic, joined, open_bag
from slams.formats.frames import Transforms
from slams.formats.kind import kind_of
from slams.formats.options import DamagedError, SourceOptions
from slams.formats.recording import Recording
from slams.scanlog import ScanLog, Track

T = TypeVar("T")

FOREIGN = ("ros1msg", "protobuf", "jsonschema", "flatbuffer")  # how mcap files call them


def read(paths: Sequence[Path], options: SourceOptions) -> ScanLog:
    """The scans of one laser with odometry, yaw rate and truth; several files are one recording.

    Raises:
        OSError: a bag cannot be opened.
        ValueError: it is damaged, has no scans, or leaves a choice open; the sentence says what
            to do.
    """
    return _of_bags(paths, options, Recording.log)


def read_track(path: Path, wanted: str | None, options: SourceOptions) -> Track:
    """Poses in a bag, without reading its scans.

    `wanted` is a topic, or a tf frame in which the base of the log moves; None takes those of a
    bag that is itself a result.

    Raises:
        OSError: the bag cannot be opened.
        ValueError: as `read`; there is no such topic or frame, or it has no poses.
    """
    return _of_bags([path], options, lambda recording: recording.track(wanted))


def contents(paths: Sequence[Path], options: SourceOptions) -> tuple[list[Topic], Transforms]:
    """The topics and transforms of a recording, whatever is in it.

    Raises:
        OSError: a bag cannot be opened.
        ValueError: it is damaged.
    """
    return _of_bags(paths, options, Recording.contents)


def _of_bags(paths: Sequence[Path], options: SourceOptions, work: Callable[[Recording], T]) -> T:
    """Read a recording by the library, or what is whole where the library cannot."""
    path, files = paths[0], [(path, kind_of(path)) for path in paths]
    try:
        with ExitStack() as opened:
            bags = [opened.enter_context(open_bag(*file)) for file in files]
            return work(Recording(*files[0], joined(path, bags), options))
    except DamagedError as error:
        foreign = _has_foreign_messages(error)
        if not (options.salvage or foreign):
            raise
        from slams.formats.bag_salvage import salvaged  # loads every decompressor

        bag = joined(path, [salvaged(*file) for file in files])
        if not bag.topics:
            raise DamagedError(f"{path}: nothing in it can be salvaged") from error
        recording = Recording(*files[0], bag, options)
        if not foreign:
            recording.notes.append(str(error).partition("; ")[0].removeprefix(f"{path}: "))
        return work(recording)


def _has_foreign_messages(error: DamagedError) -> bool:
    """Whether all that keeps the library from a whole mcap is that some messages are not ROS 2."""
    cause = error.__cause__
    return isinstance(cause, KeyError) and cause.args[0] in FOREIGN
