"""The kind of a recording, detected from the file's content alone."""

from __future__ import annotations

import re
from pathlib import Path

from slams.formats.packed import GZIP_MAGIC, unpacked

KIND_HEAD_SIZE = 1 << 16  # bytes that suffice to detect the kind
MAGIC = {
    "npz": b"PK",
    "bag": b"#ROSBAG V2.0\n",
    "mcap": b"\x89MCAP0\r\n",
    "db3": b"SQLite format 3\0",
}
CARMEN_LINE = re.compile(r"^(PARAM|SYNC|ODOM|TRUEPOS|FLASER|RLASER|(RAW|ROBOT)LASER\d)[ \t]", re.M)
BAG_KINDS = ("bag", "mcap", "db3", "folder")
OLD_BAG_MAGIC = b"#ROS"
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
UNPACK_COMMANDS = {ZSTD_MAGIC: "zstd -d", b"BZh": "bunzip2", b"\xfd7zXZ\0": "unxz"}


def kind_of(path: Path) -> str:
    """npz, bag, mcap, db3, folder (of a ROS 2 bag), carmen (also compressed by gzip) or other.

    Raises:
        OSError: the file cannot be opened.
        ValueError: another compression, a bag that is too old, or a folder without a bag.
    """
    if path.is_dir():
        if is_bag_folder(path):
            return "folder"
        raise ValueError(f"{path}: is a directory without a ROS 2 bag (metadata.yaml, .mcap, .db3)")
    with path.open("rb") as file:
        head = file.read(KIND_HEAD_SIZE)
    kind = next((kind for kind, magic in MAGIC.items() if head.startswith(magic)), None)
    command = next((c for magic, c in UNPACK_COMMANDS.items() if head.startswith(magic)), None)
    if head.startswith(GZIP_MAGIC):
        head = unpacked(head, KIND_HEAD_SIZE)[0]
        command = "gunzip" if head.startswith(tuple(MAGIC.values())) else None
    if command is not None:
        raise ValueError(f"{path}: a compressed file; unpack it first: {command} {path.name}")
    if kind is None and head.startswith(OLD_BAG_MAGIC):
        raise ValueError(f"{path}: a bag of a version before 2.0; 'rosbag fix' makes a new one")
    is_carmen = CARMEN_LINE.search(head.decode("latin-1")) and b"\0" not in head
    return kind or ("carmen" if is_carmen else "other")


def is_bag_folder(path: Path) -> bool:
    """Whether a folder holds a ROS 2 bag.

    Raises:
        OSError: the folder cannot be read.
    """
    names = [item.name for item in path.iterdir()]  # glob would hide a missing permission
    return any(name == "metadata.yaml" or name.endswith((".mcap", ".db3")) for name in names)
