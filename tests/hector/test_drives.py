"""Hector: the six steps on small drives, and the estimator's policies."""

import dataclasses

import numpy as np
import pytest

from hector import Hector, HectorParams
from slams.metrics import ate
from slams.player import replay
from slams.types import Pose2
from tests.rooms import LIDAR, scan_at


def made(**changes):
    return Hector(HectorParams(**changes))


def way(n):
    """Poses of a robot that drives a gentle arc in the room."""
    k = np.arange(n)
    return np.column_stack([0.03 * k, 0.001 * k * k, 0.01 * k])


def scans(poses, wheels=True):
    return [
        scan_at(tuple(pose), LIDAR, t=0.1 * k, odometry=Pose2(*pose) if wheels else None)
        for k, pose in enumerate(poses.tolist())
    ]


@pytest.mark.parametrize("wheels", [True, False])
def test_it_follows_a_drive_to_millimeters(wheels):
    poses = way(40)
    slam = made()
    run = replay(slam, scans(poses, wheels))
    assert ate(run.poses, poses) < 0.005
    assert slam.report()["posed"] >= 38
    assert slam.state == "matched"


def test_the_pyramid_alone_follows_it_too():
    poses = way(40)
    run = replay(made(refine=False, estimator="plain"), scans(poses))
    assert ate(run.poses, poses) < 0.02


def test_a_blind_robot_goes_on_by_its_wheels_and_says_that_it_predicts():
    poses = way(30)
    log = scans(poses)
    blind = np.full(LIDAR.n_beams, np.nan, np.float32)
    log[20:] = [dataclasses.replace(scan, ranges=blind) for scan in log[20:]]
    slam = made()
    run = replay(slam, log)
    assert ate(run.poses, poses) < 0.02
    assert slam.state == "predicted"
    assert slam.report()["empty"] == 10


def test_wheels_that_jump_do_not_move_the_pose():
    poses = way(40)
    log = scans(poses)
    for k in range(20, 40):
        odometry = Pose2(3.0, 1.0, 1.0) @ log[k].odometry
        log[k] = dataclasses.replace(log[k], odometry=odometry)
    run = replay(made(), log)
    assert np.hypot(*(run.poses - poses)[-5:, :2].T).max() < 0.05
