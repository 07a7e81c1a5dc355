"""The live commands as a user starts them, on loopback, in a domain of this process."""

import os
import subprocess
import sys

import pytest

from tests.places import ROOT

DOMAIN = 1 + os.getpid() % 100  # beyond, DDS would take ports that programs get by chance
PATIENCE = 30.0  # [s] for a machine that is busy


def environment():
    left_out = ("CYCLONEDDS_URI", "ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE")
    kept = {name: value for name, value in os.environ.items() if name not in left_out}
    return kept | {
        "PYTHONPATH": str(ROOT),
        "ROS_LOCALHOST_ONLY": "1",
        "ROS_DOMAIN_ID": str(DOMAIN),
        "PYTHONUNBUFFERED": "1",
    }


def command(module, *arguments, folder):
    return subprocess.Popen(
        [sys.executable, "-m", module, *map(str, arguments)],
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.fixture
def started():
    """Starts commands, and ends those that are left."""
    running = []

    def start(*arguments, **more):
        running.append(command(*arguments, **more))
        return running[-1]

    yield start
    for process in running:
        if process.poll() is None:
            process.kill()
        process.communicate()
