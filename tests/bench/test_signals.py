"""Commands that are ended from outside: no process stays, nothing half-written, what is done is."""

import os
import signal
import sys
import time

from tests.places import ROOT
from tests.processes import ends, in_session, processes_of, signal_group, signal_one
from tests.rooms import drive

LONG = 60.0  # s, for what happens in moments on a machine with nothing else to do

PLUGIN = """
import time
from pathlib import Path
from slams.baselines import Odometry

HERE = Path(__file__).parent

class Quick(Odometry):
    def __init__(self, params):
        super().__init__(params)
        with (HERE / "begun").open("a") as file:
            file.write("quick\\n")

class Stuck(Odometry):
    def update(self, scan):
        (HERE / "stuck").touch()
        while not (HERE / "free").exists():
            time.sleep(0.01)
        return super().update(scan)
"""


def started(*words, folder):
    """A command in a session of its own, with this source tree and the folder's modules."""
    path = os.pathsep.join([str(ROOT), str(folder)])
    command = [sys.executable, "-m", *words]
    return in_session(command, cwd=folder, env=os.environ | {"PYTHONPATH": path})


def wait_for(what, process):
    deadline = time.monotonic() + LONG
    while not what():
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < deadline
        time.sleep(0.01)


def ended(process, send, number):
    """Sends it a signal; its exit code and last words, when none of its processes is left."""
    send(process, number)
    _, said = process.communicate(timeout=LONG)
    assert ends(processes_of(process.pid), LONG)
    return process.returncode, said


def test_a_comparison_that_is_ended_leaves_nothing(tmp_path):
    """Ended by SIGTERM, then by Ctrl-C, in the midst of a run."""
    (tmp_path / "plugin.py").write_text(PLUGIN)
    drive(n=8).save(tmp_path / "room.npz")
    words = ["bench.compare", "room.npz", "--out", "out", "--jobs", "2", "--algorithms"]
    words += ["plugin:Quick", "plugin:Stuck"]
    for send, number, code, word in (
        (signal_one, signal.SIGTERM, 143, "terminated"),
        (signal_group, signal.SIGINT, 130, "interrupted"),
    ):
        (tmp_path / "stuck").unlink(missing_ok=True)
        process = started(*words, folder=tmp_path)
        wait_for((tmp_path / "stuck").exists, process)
        returned, said = ended(process, send, number)
        assert (returned, said.splitlines()[-1]) == (code, f"slams compare: {word}")
        assert "Traceback" not in said
        assert list(tmp_path.glob(".*.part")) == []
        assert not (tmp_path / "out").exists()
