"""--record: all messages in and out, as one mcap file."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from slams.formats.mcap import McapFile
from slams.live.options import TOPICS, NodeOptions, Quality
from slams.ros.messages import SCAN


class Recorder:
    """Writes messages in a thread of its own, so that no scan waits for the disk.

    Raises:
        OSError: the file cannot be written.
        ValueError: its name does not end in .mcap.
    """

    def __init__(self, path: str | Path, options: NodeOptions) -> None:
        if Path(path).suffix != ".mcap":
            raise ValueError(f"--record: got {path}, expected a name that ends in .mcap")
        names = options.names
        others = {
            names[name]: (msgtype, how is Quality.LATCHED)
            for name, (msgtype, how) in TOPICS.items()
            if name != "/scan"
        }
        self._file = McapFile(path, dict.fromkeys(options.scans, (SCAN, False)) | others)
        self._failed: Exception | None = None
        self._writing = ThreadPoolExecutor(1, "recorder")

    def put(self, topic: str, received: int, data: bytes) -> None:
        """Take a message that was received at a time [ns]; never waits."""
        self._writing.submit(self._write, topic, received, data)

    def close(self, keep: bool = True) -> None:
        """Write the messages that still wait and give the file its name, or leave no file.

        Raises:
            OSError: some of it could not be written; then there is no file.
        """
        self._writing.shutdown()
        self._file.close(keep and self._failed is None)
        if keep and self._failed is not None:
            raise OSError(f"{self._file.path}: not recorded: {self._failed}") from self._failed

    def _write(self, topic: str, received: int, data: bytes) -> None:
        """Write a message, unless an earlier one failed."""
        try:
            if self._failed is None:
                self._file.write(topic, received, data)
        except Exception as error:  # the library raises its own and the disk's
            self._failed = error
