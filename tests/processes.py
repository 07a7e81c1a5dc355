"""Processes that a test started: whether they live, who they are, signals to them."""

import contextlib
import os
import time
from pathlib import Path


def is_alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def ends(pids, within=10.0):
    deadline = time.monotonic() + within
    while any(map(is_alive, pids)):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.005)
    return True


def processes_of(session):
    """Living processes of a session, all that a command started."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = path.read_text().rpartition(")")[2].split()
            if fields[3] == str(session) and fields[0] != "Z":
                found.append(int(path.parent.name))
    return found


def signal_one(process, number):
    os.kill(process.pid, number)


def signal_group(process, number):
    os.killpg(process.pid, number)  # as a terminal does
