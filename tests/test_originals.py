"""Originals drive as the published programs do, by the programs' own trajectories."""

import numpy as np
import pytest

import slams
from slams.formats.trajectory import read

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
