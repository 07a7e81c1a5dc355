"""ROS bags: a ScanLog or one track from a whole bag, or from what is whole in a damaged one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TypeVar

from slams.formats.bag import Bag, SeveralBags, open_bag
from slams.formats.options import DamagedError, SourceOptions
from slams.formats.recording import Contents, Recording
from slams.scanlog import ScanLog, Track

T = TypeVar("T")

FOREIGN = ("ros1msg", "protobuf", "jsonschema", "flatbuffer")  # how mcap files call them


def read(paths: Sequence[Path], kinds: Sequence[str], options: SourceOptions) -> ScanLog:
    """The scans of one laser with odometry, yaw rate and truth; several files are one recording.

    Raises:
        OSError: a bag cannot be opened.
        ValueError: it is damaged, has no scans, or leaves a choice open; the sentence says what
            to do.
    """
    return _of_bags(paths, kinds, options, Recording.log)


def read_track(path: Path, kind: str, wanted: str | None, options: SourceOptions) -> Track:
    """Poses in a bag, without reading its scans.

    `wanted` is a topic, or a tf frame in which the base of the log moves; None takes those of a
    bag that is itself a result.

    Raises:
        OSError: the bag cannot be opened.
        ValueError: as `read`; there is no such topic or frame, or it has no poses.
    """
    return _of_bags([path], [kind], options, lambda recording: recording.track(wanted))


def contents(paths: Sequence[Path], kinds: Sequence[str], options: SourceOptions) -> Contents:
    """The topics and transforms of a recording, whatever is in it.

    Raises:
        OSError: a bag cannot be opened.
        ValueError: it is damaged.
    """
    return _of_bags(paths, kinds, options, Recording.contents)


def _of_bags(
    paths: Sequence[Path],
    kinds: Sequence[str],
    options: SourceOptions,
    work: Callable[[Recording], T],
) -> T:
    """Read a recording by the library, or what is whole where the library cannot."""
    named = list(zip(paths, kinds, strict=True))
    try:
        with ExitStack() as opened:
            bags: list[Bag] = [opened.enter_context(open_bag(*pair)) for pair in named]
            return work(Recording(paths[0], kinds[0], _joined(paths[0], bags), options))
    except DamagedError as error:
        if not (options.salvage or _has_foreign_messages(error)):
            raise
        from slams.formats.bag_salvage import SalvagedBag  # loads every decompressor

        bags = [SalvagedBag(*pair) for pair in named]
        if not any(bag.topics for bag in bags):
            raise DamagedError(f"{paths[0]}: nothing in it can be salvaged") from error
        recording = Recording(paths[0], kinds[0], _joined(paths[0], bags), options)
        if not _has_foreign_messages(error):
            recording.notes.append(str(error).partition("; ")[0].removeprefix(f"{paths[0]}: "))
        return work(recording)


def _joined(path: Path, bags: Sequence[Bag]) -> Bag:
    if len({bag.ros1 for bag in bags}) > 1:
        raise ValueError(f"{path}: some of the files are of ROS 1 and of ROS 2 the others")
    return bags[0] if len(bags) == 1 else SeveralBags(bags)


def _has_foreign_messages(error: DamagedError) -> bool:
    """Whether all that keeps the library from a whole mcap is that some messages are not ROS 2."""
    cause = error.__cause__
    return isinstance(cause, KeyError) and cause.args[0] in FOREIGN
