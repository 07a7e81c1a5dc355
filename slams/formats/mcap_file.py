"""An mcap file that is written message by message and appears whole or not at all."""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from slams.formats.bag import store


class McapFile:
    """A ROS 2 bag of one file; as a context: renamed when it ends without an error.

    Args:
        path: of the file.
        types: message type of each topic.
        kept: topics whose last message stays for later subscribers, as live nodes have it.

    Raises:
        OSError: it cannot be written.
    """

    def __init__(self, path: str | Path, types: Mapping[str, str], kept: Collection[str]) -> None:
        from rosbags.rosbag2 import StoragePlugin, Writer

        self.path = Path(path)
        prefix = f".{self.path.name}."
        self._folder = tempfile.TemporaryDirectory(prefix=prefix, dir=self.path.parent)
        bag = Path(self._folder.name) / "bag"
        try:
            self._writer: Any = Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP)
            self._writer.open()
            self._connections = {
                topic: self._writer.add_connection(
                    topic, kind, typestore=store(), offered_qos_profiles=[_qos(topic in kept)]
                )
                for topic, kind in types.items()
            }
        except BaseException:
            self._folder.cleanup()
            raise

    def write(self, topic: str, stamp: int, data: bytes | memoryview) -> None:
        """Store a message, as CDR, at a time [ns]."""
        self._writer.write(self._connections[topic], stamp, data)

    def close(self, keep: bool = True) -> None:
        """Finish the file and give it its name, or leave nothing of it."""
        again = () if keep else (Exception,)  # whatever went wrong before may go wrong again
        with self._folder, suppress(*again):
            self._writer.close()
            if keep:
                next(Path(self._folder.name).rglob("*.mcap")).replace(self.path)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        self.close(keep=kind is None)


def _qos(kept: bool) -> Any:
    """Reliable; what is sent once stays for later subscribers."""
    from rosbags import interfaces

    forever = interfaces.QosTime(sec=2147483647, nsec=4294967295)
    durability = interfaces.QosDurability
    return interfaces.Qos(
        history=interfaces.QosHistory.KEEP_LAST,
        depth=1 if kept else 10,
        reliability=interfaces.QosReliability.RELIABLE,
        durability=durability.TRANSIENT_LOCAL if kept else durability.VOLATILE,
        deadline=forever,
        lifespan=forever,
        liveliness=interfaces.QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=forever,
        avoid_ros_namespace_conventions=False,
    )
