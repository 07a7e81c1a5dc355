"""ROS 1 for real: a master, the player and the node, where Debian's rospy is installed."""

import os
import shutil
import signal
import socket
import subprocess
import time
from importlib.util import find_spec

import numpy as np
import pytest

import slams
from slams.player import replay
from tests.rooms import drive, laser
from tests.slams.live.commands import PATIENCE

NEEDED = ("rospy", "rosgraph", "roslib", "nav_msgs", "sensor_msgs", "tf2_msgs", "diagnostic_msgs")
MASTER = shutil.which("rosmaster")
SYSTEM = "/usr/bin/python3"  # whose packages the master needs

if MASTER is None or not all(map(find_spec, NEEDED)):
    pytest.skip("needs ROS 1: rosmaster, rospy and its messages", allow_module_level=True)


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def answers(port):
    with socket.socket() as one:
        return one.connect_ex(("127.0.0.1", port)) == 0


@pytest.fixture
def master(monkeypatch, tmp_path):
    """A master of its own on loopback."""
    port = free_port()
    monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{port}")
    monkeypatch.setenv("ROS_IP", "127.0.0.1")
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "roslog"))
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    process = subprocess.Popen([SYSTEM, MASTER, "--core", "-p", str(port)], env=environment)
    end = time.monotonic() + PATIENCE
    while not answers(port):
        assert time.monotonic() < end
        time.sleep(0.1)
    yield
    process.terminate()
    process.wait()


def test_a_log_is_mapped_by_ros_1_and_a_run_of_the_recording_gives_its_poses(
    master, started, tmp_path
):
    drive(n=60, lidar=laser(181)).save(tmp_path / "room.npz")
    more = ("--ros1", "--out", "out", "--record", "seen.mcap", "--patience", PATIENCE, "--wait", 5)
    live = started("slams.live", "hector", *more, folder=tmp_path)
    assert "ready for scans on /scan" in live.stderr.readline()
    play = started("slams.play", "room.npz", "--ros1", "--wait", PATIENCE, folder=tmp_path)
    said, error = play.communicate(timeout=2 * PATIENCE)
    assert (play.returncode, said) == (0, "60 scans of room published\n"), error
    time.sleep(1.0)
    live.send_signal(signal.SIGINT)
    said, error = live.communicate(timeout=PATIENCE)
    assert live.returncode == 0, error
    assert said.startswith("60 scans, 0 left out")
    run = replay(slams.create("hector"), slams.load(tmp_path / "seen.mcap"))
    written = np.loadtxt(tmp_path / "out" / "trajectory.csv", delimiter=",", skiprows=1)
    assert np.array_equal(written, np.round(np.column_stack([run.t, run.poses]), 9))
