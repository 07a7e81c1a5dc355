"""What an algorithm says of its errors is so: neither ten times too sure, nor a tenth.

Errors of poses are normalized by what was said of them, in seeded drives of 15 s in a maze at 5 Hz.
"""

from functools import cache

import numpy as np
import pytest

from bench.sim.setting import Setting
from bench.sim.simulation import simulate
from slams import metrics
from slams.player import replay
from slams.registry import create
from slams.types import Pose2, wrap_angle

NAMES = ["hector", "tsd", "crsm"]


def drive(seed, odometry, size=9.0, duration=15.0):
    log = simulate(Setting(size=size, duration=duration, seed=seed))
    return log.select(every=8, odometry=odometry)


def normalized(name, log):
    """Mean squared error per degree of freedom, in units of the covariance: in two frames.

    In that of the map where it lies best on the truth, as for the ATE: a covariance is that of a
    pose against the map. And in that of the first pose, where the first scan's error counts in
    every pose, though no covariance can know of it.
    """
    slam, said = create(name), []
    run = replay(slam, log, watch=lambda scan, pose: said.append(slam.covariance.copy()))
    truth = log.truth_at(run.t)
    fitted = metrics.align(truth, run.poses)
    first = Pose2(*run.poses[0]) @ Pose2(*truth[0]).inverse()
    return [mean_square(run.poses[1:], truth[1:], said[1:], frame) for frame in (fitted, first)]


def mean_square(poses, truth, covariances, frame):
    squares = []
    for pose, true, covariance in zip(poses, truth, covariances, strict=True):
        error = pose - np.array(frame @ Pose2(*true))
        error[2] = wrap_angle(error[2])
        squares.append(error @ np.linalg.solve(covariance, error))
    return np.mean(squares) / 3.0


@cache
def drives(odometry):
    return [drive(seed, odometry) for seed in range(4)]


@pytest.mark.parametrize("odometry", [True, False])
@pytest.mark.parametrize("name", NAMES)
def test_the_covariance_of_a_pose_is_honest(name, odometry):
    """Measured over 4 drives: 0.5 to 0.8, and 1.3 to 2.6 in the first pose's frame."""
    fitted, first = np.mean([normalized(name, log) for log in drives(odometry)], axis=0)
    assert 0.4 < fitted < 1.5
    assert 0.5 < first < 2.9
