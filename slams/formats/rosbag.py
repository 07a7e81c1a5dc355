"""ROS bags: read by the library, or what is whole in a damaged one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TypeVar

from slams.formats.bag import joined, open_bag
from slams.formats.kind import kind_of
from slams.formats.options import DamagedError, SourceOptions
from slams.formats.recording import Recording

T = TypeVar("T")

FOREIGN = ("ros1msg", "protobuf", "jsonschema", "flatbuffer")  # how mcap files call them


def read(paths: Sequence[Path], options: SourceOptions, work: Callable[[Recording], T]) -> T:
    """What `work` makes of a recording, several files being one; or of what is whole in it.

    Raises:
        OSError: a bag cannot be opened.
        ValueError: it is damaged, or lacks what is sought; the sentence says what to do.
    """
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
