"""The published program's own trajectory, and that of the preset that is modeled on it."""

import numpy as np

import slams
from slams.formats.trajectory import read
from slams.registry import create


def test_the_original_drives_as_the_program_does(shared_data):
    log = slams.load(shared_data("data/robocup/robocup.npz")).select(250, odometry=False)
    poses = slams.replay(create("tsd@original"), log).poses
    assert np.hypot(*poses[:, :2].T).max() > 0.5  # it has left the start
    _, expected = read(shared_data("reference/robocup/tsd_tsd.csv.gz"))
    assert np.abs(poses - expected[: len(poses)]).max() < 0.02  # m, rad
