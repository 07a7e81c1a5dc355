"""From a recorded file of whatever kind to a ScanLog: the kind is found out by the content."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from slams.scanlog import ScanLog

KNOWN = "an npz file, a ROS bag, a CARMEN log or a BreezySLAM .dat"
HEAD = 1 << 16
MAGIC = {
    b"PK": "npz",
    b"#ROSBAG V2.0\n": "bag",
    b"\x89MCAP0\r\n": "mcap",
    b"SQLite format 3\0": "db3",
}
GZIP, OLD_BAG = b"\x1f\x8b", b"#ROS"
PACKED = {b"\x28\xb5\x2f\xfd": "zstd -d", b"BZh": "bunzip2", b"\xfd7zXZ\0": "unxz"}
FAMILY = {"npz": "an npz file", "carmen": "a CARMEN log", "breezy": "a BreezySLAM .dat"}
NOT_IN = {  # options that say nothing about a kind; what is not named is a bag
    "npz": ("scan_topic", "odom", "imu", "base_frame", "first_beam"),
    "carmen": ("imu", "base_frame"),
    "breezy": ("scan_topic", "odom", "imu", "base_frame"),
}
COVERED = 0.9  # share of the scans that a track should reach over


@dataclass(frozen=True)
class SourceOptions:
    """What to take from a recorded file; None = decided by what is in it.

    `scan_topic` names the laser (a topic, or a CARMEN message such as RLASER), `odom` an odometry
    topic or TF frame, `imu` a topic, `truth` a topic, a TF frame or a trajectory file; "none" does
    without. `base_frame` is the TF frame that poses are of. `first_beam` [deg] is the direction of
    the first reading where the file does not tell it. `salvage` reads what is whole in a damaged
    file instead of refusing it.
    """

    scan_topic: str | None = None
    odom: str | None = None
    imu: str | None = None
    truth: str | None = None
    base_frame: str | None = None
    first_beam: float | None = None
    salvage: bool = False


class DamagedError(ValueError):
    """The file is cut short or corrupt; what is whole in it can perhaps be salvaged."""


def read(path: Path, options: SourceOptions) -> ScanLog:
    """The scan log recorded in a file or in the folder of a ROS 2 bag.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it holds no scan log, or the options do not fit; the sentence says why.
    """
    first = options.first_beam
    if first is not None and not abs(first) <= 360.0:
        raise ValueError(f"--first-beam: got {first:g}, expected degrees from -360 to 360")
    kind = kind_of(path)
    if kind in FAMILY:
        log = _with_truth(_read_file(path, kind, options), options)
    else:
        from slams.formats import rosbag

        log = rosbag.read(path, kind, options)
    return _noted(log, [*log.notes, *_left_aside(kind, options), *_uncovered(log)])


def _noted(log: ScanLog, notes: list[str]) -> ScanLog:
    """The log with its notes, in its meta behind those of an earlier conversion."""
    earlier = log.meta.get("notes")
    kept = [note for note in earlier if note not in notes] if isinstance(earlier, list) else []
    meta = log.meta | {"notes": [*kept, *notes]}
    return replace(log, notes=tuple(notes), meta=meta) if notes else log


def _read_file(path: Path, kind: str, options: SourceOptions) -> ScanLog:
    from slams.formats import breezy, carmen

    if kind == "npz":
        return _read_npz(path, options)
    return carmen.read(path, options) if kind == "carmen" else breezy.read(path, options)


def _read_npz(path: Path, options: SourceOptions) -> ScanLog:
    from slams.scanlog import load_npz

    try:
        log = load_npz(path)
    except OSError as error:
        if error.filename is not None:
            raise
        reason = f"damaged or cut short ({error}); copy it again"
        raise ValueError(f"{path}: {reason}") from error  # a place outside of the file
    choices = {"odom": options.odom, "yaw_rate": options.imu}
    hidden: dict[str, Any] = {key: None for key, choice in choices.items() if choice == "none"}
    return replace(log, **hidden) if hidden else log


def _with_truth(log: ScanLog, options: SourceOptions) -> ScanLog:
    """Files without topics and frames take the truth from a trajectory file."""
    from slams.formats import trajectory
    from slams.scanlog import Track

    if options.truth is None:
        return log
    if options.truth == "none":
        return replace(log, truth=None)
    truth, source = Track(*trajectory.read(options.truth)), log.meta.get("source", {})
    if isinstance(source, dict):  # in an npz of others it can be anything
        source = source | {"truth": Path(options.truth).name}
    return replace(log, truth=truth, meta=log.meta | {"source": source})


def _left_aside(kind: str, options: SourceOptions) -> list[str]:
    """Tell of options that were given and say nothing about this kind of log."""
    names = NOT_IN.get(kind, ("first_beam",))
    given = [name for name in names if getattr(options, name) not in (None, "none")]
    flags = ", ".join(f"--{name.replace('_', '-')}" for name in given)
    return [f"{flags}: nothing to choose in {FAMILY.get(kind, 'a bag')}"] if given else []


def _uncovered(log: ScanLog) -> list[str]:
    """Tell of tracks that do not reach over the scans."""
    tracks = {"odometry": log.odom, "the truth": log.truth, "the yaw rate": log.yaw_rate}
    notes = []
    for name, track in tracks.items():
        if track is not None:
            inside = int(((log.t >= track.t.min()) & (log.t <= track.t.max())).sum())
            if inside < COVERED * len(log):
                notes.append(f"{name} covers {inside} of {len(log)} scans")
    return notes


def kind_of(path: Path) -> str:
    """npz, bag, mcap, db3, folder (of a ROS 2 bag), carmen or breezy, by the content alone.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is none of them.
    """
    if path.is_dir():
        return _kind_of_folder(path)
    with path.open("rb") as file:
        head = file.read(HEAD)
    for magic, kind in MAGIC.items():
        if head.startswith(magic):
            return kind
    for magic, command in PACKED.items():
        if head.startswith(magic):
            raise _packed(path, command)
    if head.startswith(OLD_BAG):
        raise ValueError(f"{path}: a bag of a version before 2.0; 'rosbag fix' makes a new one")
    return _kind_of_text(path, head)


def text_of(path: Path, salvage: bool, notes: list[str]) -> str:
    """A text file, packed by gzip or not. What is cut short is refused, or read as far as it goes.

    Raises:
        DamagedError: the packed file is cut short or corrupt.
    """
    data = path.read_bytes()
    if not data.startswith(GZIP):
        return data.decode("latin-1")
    text, reason = _unpacked(data)
    if reason and not salvage:
        raise DamagedError(f"{path}: {reason}; copy it again, or --salvage what is whole")
    if reason:
        notes.append(f"{reason}; read as far as it goes")
    return text.decode("latin-1")


def name_of(path: Path) -> str:
    """What a log is called: the file's name without its endings."""
    return path.resolve().name.removesuffix(".gz").rpartition(".")[0] or path.resolve().name


def _packed(path: Path, command: str) -> ValueError:
    return ValueError(f"{path}: compressed as a whole; unpack it first: {command} {path.name}")


def _kind_of_folder(path: Path) -> str:
    names = [item.name for item in path.iterdir()]  # glob finds nothing where it may not look
    if any(name == "metadata.yaml" or name.endswith((".mcap", ".db3")) for name in names):
        return "folder"
    raise ValueError(f"{path}: is a directory without a ROS 2 bag (metadata.yaml, .mcap, .db3)")


def _kind_of_text(path: Path, head: bytes) -> str:
    from slams.formats import breezy, carmen

    if head.startswith(GZIP):
        head = _unpacked(head, HEAD)[0]
        if head.startswith(tuple(MAGIC)):
            raise _packed(path, "gunzip")
    text = head.decode("latin-1")
    if carmen.is_carmen(text):
        return "carmen"
    if breezy.is_breezy(text):
        return "breezy"
    given = "" if head else "empty; "
    raise ValueError(f"{path}: {given}not {KNOWN}")


def _unpacked(data: bytes, most: int = 0) -> tuple[bytes, str]:
    """What gzip packed, at most so many bytes (0 = all), and what is wrong with it if anything."""
    parts, size = [], 0
    while data.startswith(GZIP):
        stream = zlib.decompressobj(wbits=31)
        try:
            parts.append(stream.decompress(data, max(most - size, 1) if most else 0))
        except zlib.error:
            return b"".join([*parts, _whole_start(data)]), "packed data are corrupt"
        size += len(parts[-1])
        if most and size >= most:
            return b"".join(parts), ""
        if not stream.eof:
            return b"".join(parts), "packed data end too early"
        data = stream.unused_data
    return b"".join(parts), ""


def _whole_start(data: bytes, step: int = 4096) -> bytes:
    """As much as unpacks before the first fault."""
    stream, parts = zlib.decompressobj(wbits=31), []
    try:
        for start in range(0, len(data), step):
            parts.append(stream.decompress(data[start : start + step]))
    except zlib.error:
        pass
    return b"".join(parts)
