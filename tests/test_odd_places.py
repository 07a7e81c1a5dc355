"""Folders, disks and homes as they can be: results whole, or one sentence and nothing left."""

import os
import resource
import subprocess
import sys

import numpy as np
import pytest

import slams
from slams.scanlog import ScanLog
from tests import bags
from tests.places import ROOT
from tests.processes import python
from tests.rooms import drive

TORN = os.fsdecode(b"a\xff")  # a name that is not UTF-8
FULL = 2048  # bytes that a file may have on the disk that is full


def run(folder, *arguments, full=False):
    """slams.run in a process of its own: OpenCV crashes on such names."""

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (FULL, resource.RLIM_INFINITY))

    words = [sys.executable, "-m", "slams.run", "odometry", *map(os.fsencode, map(str, arguments))]
    env, before = os.environ | {"PYTHONPATH": str(ROOT)}, limit if full else None
    return subprocess.run(words, cwd=folder, env=env, capture_output=True, preexec_fn=before)


@pytest.fixture
def log(tmp_path):
    """A log whose name is that of its file."""
    whole = drive(n=10)
    path = tmp_path / "log.npz"
    ScanLog(whole.t, whole.ranges, whole.laser, whole.odom).save(path)
    return path


def parts(folder):
    return [path for path in folder.iterdir() if path.name.startswith(".")]


def test_names_that_are_not_utf8(log, tmp_path):
    torn = log.rename(tmp_path / f"{TORN}.npz")
    done = run(tmp_path, torn, "--mcap")
    assert (done.returncode, done.stderr) == (0, b"")
    assert os.fsencode(TORN) in done.stdout
    out = tmp_path / "results" / f"{TORN}-odometry"
    names = {path.name for path in out.iterdir()}
    assert {"map.png", "map.pgm", "result.mcap", "summary.json"} <= names
    assert parts(tmp_path) == parts(out.parent) == []


def test_results_on_a_full_disk(log, tmp_path):
    done = run(tmp_path, log, "-q", "--mcap", full=True)
    assert done.returncode == 2
    assert done.stderr.count(b"\n") == 1
    assert list((tmp_path / "results").iterdir()) == []


def test_matplotlib_says_nothing_where_there_is_no_home(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    for name in [name for name in os.environ if name.startswith(("XDG", "MPL"))]:
        monkeypatch.delenv(name)
    plot = "def plot():\n    import matplotlib.figure\n    return 0\n"
    code = f"from slams import cli\n{plot}cli.run_command('x', plot)"
    done = python("-c", code, HOME=str(tmp_path / "file" / "none"))
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("salvage", [False, True])
def test_a_bare_file_of_compressed_messages_asks_for_its_folder(salvage, tmp_path):
    def scans(make):
        return [("/scan", t, make.scan(t, np.ones(50))) for t in 0.1 * np.arange(5)]

    folder = bags.write(tmp_path, "folder-db3-each", scans)
    assert len(slams.load(folder)) == 5
    (bare,) = folder.glob("*.db3")
    sentence = bags.refused(bare, salvage=salvage)
    assert "messages are compressed" in sentence and "give the folder" in sentence
