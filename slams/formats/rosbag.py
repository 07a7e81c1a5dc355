"""ROS bags: a ScanLog or one track from a whole bag, or from what is whole in a damaged one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TypeVar

from slams.formats.bag import Bag, SeveralBags, open_bag
from slams.formats.options import DamagedError, SourceOptions
from slams.formats.recording import Recording
from slams.scanlog import ScanLog, Track

T = TypeVar("T")

FOREIGN = ("ros1msg", "protobuf", "jsonschema", "flatbuffer")  # how mcap files call them


def read(path: Path, kind: str, options: SourceOptions) -> ScanLog:
    """The scans of one laser with odometry, yaw rate and truth.

    Raises:
        OSError: the bag cannot be opened.
        ValueError: it is damaged, has no scans, or leaves a choice open; the sentence says what
            to do.
    """
    return _of_bag(path, kind, options, Recording.log)


def read_several(paths: Sequence[Path], kinds: Sequence[str], options: SourceOptions) -> ScanLog:
    """As `read`, of a recording in several files; it is called as the first of them.

    Raises:
        OSError: a file cannot be opened.
        ValueError: as `read`; or some are of ROS 1 and some of ROS 2.
    """
    with ExitStack() as opened:
        bags = [
            _opened(path, kind, options, opened) for path, kind in zip(paths, kinds, strict=True)
        ]
        if len({bag.ros1 for bag in bags}) > 1:
            raise ValueError(f"{paths[0]}: some of the files are of ROS 1 and of ROS 2 the others")
        return Recording(paths[0], kinds[0], SeveralBags(bags), options).log()


def _opened(path: Path, kind: str, options: SourceOptions, opened: ExitStack) -> Bag:
    if not options.salvage:
        return opened.enter_context(open_bag(path, kind))
    from slams.formats.bag_salvage import SalvagedBag  # loads every decompressor

    return SalvagedBag(path, kind)


def read_track(path: Path, kind: str, wanted: str | None, options: SourceOptions) -> Track:
    """Poses in a bag, without reading its scans.

    `wanted` is a topic, or a tf frame in which the base of the log moves; None takes those of a
    bag that is itself a result.

    Raises:
        OSError: the bag cannot be opened.
        ValueError: as `read`; there is no such topic or frame, or it has no poses.
    """
    return _of_bag(path, kind, options, lambda recording: recording.track(wanted))


def _of_bag(path: Path, kind: str, options: SourceOptions, work: Callable[[Recording], T]) -> T:
    """Read a bag by the library, or what is whole in one that the library does not read."""
    try:
        with open_bag(path, kind) as bag:
            return work(Recording(path, kind, bag, options))
    except DamagedError as error:
        if not (options.salvage or _has_foreign_messages(error)):
            raise
        from slams.formats.bag_salvage import SalvagedBag  # loads every decompressor

        rest = SalvagedBag(path, kind)
        if not rest.topics:
            raise DamagedError(f"{path}: nothing in it can be salvaged") from error
        recording = Recording(path, kind, rest, options)
        if not _has_foreign_messages(error):
            recording.notes.append(str(error).partition("; ")[0].removeprefix(f"{path}: "))
        return work(recording)


def _has_foreign_messages(error: DamagedError) -> bool:
    """Whether all that keeps the library from a whole mcap is that some messages are not ROS 2."""
    cause = error.__cause__
    return isinstance(cause, KeyError) and cause.args[0] in FOREIGN
