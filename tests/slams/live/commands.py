"""The live commands as a user starts them, on loopback, in a domain of this process."""

import os
import sys

from tests.places import ROOT
from tests.processes import in_session

DOMAIN = 1 + os.getpid() % 100  # beyond, DDS would take ports that programs get by chance
PATIENCE = 60.0  # [s] for a machine that is busy


def environment():
    left_out = ("CYCLONEDDS_URI", "ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE")
    kept = {name: value for name, value in os.environ.items() if name not in left_out}
    return kept | {
        "PYTHONPATH": str(ROOT),
        "ROS_LOCALHOST_ONLY": "1",
        "ROS_DOMAIN_ID": str(DOMAIN),
        "PYTHONUNBUFFERED": "1",
    }


def started(module, *arguments, folder):
    return in_session([sys.executable, "-m", module, *arguments], cwd=folder, env=environment())
