"""--record: writes all received and published messages to one mcap file."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from slams.formats.mcap import McapFile
from slams.live.options import NODE_TOPICS, NodeOptions, Quality
from slams.ros.messages import SCAN_TYPE


class Recorder:
    """Writes messages in its own thread, so that no scan waits for the disk.

    Raises:
        OSError: the file cannot be written.
    """

    def __init__(self, path: str | Path, options: NodeOptions) -> None:
        names = options.names
        others = {
            names[name]: (msgtype, quality is Quality.LATCHED)
            for name, (msgtype, quality) in NODE_TOPICS.items()
            if name != "/scan"
        }
        self._file = McapFile(path, dict.fromkeys(options.scans, (SCAN_TYPE, False)) | others)
        self._failure: Exception | None = None
        self._thread = ThreadPoolExecutor(1, "recorder")

    def put(self, topic: str, received: int, data: bytes) -> None:
        """Queue a message with its time of receiving [ns]; never waits."""
        self._thread.submit(self._write, topic, received, data)

    def close(self, keep: bool = True) -> None:
        """Write the queued messages and give the file its name, or leave no file.

        Raises:
            OSError: a message could not be written; then there is no file.
        """
        self._thread.shutdown()
        try:
            self._file.close(keep and self._failure is None)
        except Exception as error:
            self._failure = error
        if keep and self._failure is not None:
            raise OSError(f"{self._file.path}: not recorded: {self._failure}") from self._failure

    def _write(self, topic: str, received: int, data: bytes) -> None:
        """Write a message, unless an earlier write failed."""
        try:
            if self._failure is None:
                self._file.write(topic, received, data)
        except Exception as error:  # errors of the library and of the disk
            self._failure = error
