"""Processes that a test started: whether they live, who they are, signals to them."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from tests.places import ROOT

OPEN = []  # commands in sessions of their own that no test has seen the end of


def python(*words, cwd=ROOT, **variables):
    """A process of Python that has ended; `variables` of its environment besides ours."""
    line, env = [sys.executable, *map(str, words)], os.environ | variables
    return subprocess.run(line, cwd=cwd, env=env, capture_output=True, text=True)


def in_session(words, **more):
    """A command in a session of its own, which `close_sessions` ends with all that it started."""
    pipe = subprocess.PIPE
    process = subprocess.Popen(
        [*map(str, words)], start_new_session=True, stdout=pipe, stderr=pipe, text=True, **more
    )
    OPEN.append(process)
    return process


def close_sessions():
    """Kill what is left of every session, also what begins meanwhile."""
    while OPEN:
        process = OPEN.pop()
        while left := processes_of(process.pid):
            for pid in left:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            process.poll()  # a parent has to ask, or it stays for dead
        process.communicate()


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
