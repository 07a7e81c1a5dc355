"""A public log: the programs' own trajectories, as which originals drive, and the truth."""

import numpy as np
import pytest

import slams
from slams import metrics
from slams.formats.trajectory import read
from tests.rooms import ALGORITHMS

# scans, with odometry, farthest from the nearest and from all of the references [m, rad]
PROGRAMS = {
    "hector": (100, False, ("hector",), 0.003, 0.003),
    "tsd": (250, False, ("tsd_tsd",), 0.02, 0.02),
    # three seeds of the program differ by up to 2 cm within these 15 s
    "gmapping": (600, True, ("gmapping_s1", "gmapping_s2", "gmapping_s3"), 0.02, 0.03),
}


@pytest.mark.parametrize("name", PROGRAMS)
def test_an_original_drives_as_its_program_does(name, shared_data):
    scans, odometry, references, least, most = PROGRAMS[name]
    log = slams.load(shared_data("data/robocup/robocup.npz")).select(scans, odometry=odometry)
    poses, off = slams.replay(slams.create(f"{name}@original"), log).poses, []
    assert np.hypot(*poses[:, :2].T).max() > 0.1  # it has left the start
    for reference in references:
        _, expected = read(shared_data(f"reference/robocup/{reference}.csv.gz"))
        off.append(np.abs(poses - expected[: len(poses)]).max())
    assert min(off) < least and max(off) < most


@pytest.mark.parametrize("name", ALGORITHMS)
def test_a_default_is_accurate_with_the_laser_alone(name, shared_data):
    """Measured: 0.5 to 0.6 mm."""
    log = slams.load(shared_data("data/robocup/robocup.npz")).select(400, odometry=False)
    run = slams.replay(slams.create(name), log)
    assert metrics.ate(run.poses, log.truth_at(run.t)) < 0.001
