"""Memory of a run, and the record of command, machine and versions."""

from __future__ import annotations

import argparse
import contextlib
import os
import platform
import shlex
from pathlib import Path
from typing import Any

from slams.cli import THREAD_VARIABLES

STATUS_FILE = Path("/proc/self/status")
PEAK_RESET_FILE = Path("/proc/self/clear_refs")


class PeakMemory:
    """Context that measures the increase of this process's memory [MB].

    `mb` is None on systems without Linux's /proc.
    """

    mb: float | None = None

    def __enter__(self) -> PeakMemory:
        with contextlib.suppress(OSError):
            PEAK_RESET_FILE.write_text("5")
        self._before = _status("VmRSS")
        return self

    def __exit__(self, *_: object) -> None:
        peak = _status("VmHWM")
        if peak is not None and self._before is not None:
            self.mb = max(peak - self._before, 0.0)


def _status(key: str) -> float | None:
    """A line of /proc/self/status [MB]."""
    try:
        text = STATUS_FILE.read_text()
    except OSError:
        return None
    line = next((line for line in text.splitlines() if line.startswith(f"{key}:")), None)
    return None if line is None else int(line.split()[1]) / 1024.0


def record(arguments: argparse.Namespace, **more: Any) -> dict[str, Any]:
    """Command, machine (with `more` entries) and versions."""
    from slams.summary import versions

    command = f"{arguments.program} {shlex.join(arguments.words)}".strip()
    return {"command": command, "versions": versions(), "machine": machine() | more}


def machine() -> dict[str, Any]:
    """The machine of the run, if the system provides it."""
    cpu = platform.processor() or platform.machine()
    with contextlib.suppress(OSError, StopIteration):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        cpu = next(ln for ln in lines if ln.startswith("model name")).partition(":")[2].strip()
    threads = {name: os.environ.get(name) for name in THREAD_VARIABLES}
    return {"cpu": cpu, "system": platform.system(), "threads": threads}
