"""tsd: drives, motions that are known, recovery from what wheels do."""

from itertools import pairwise

import numpy as np
import pytest

from slams import load
from slams.player import replay
from slams.types import IDENTITY, Pose2, Scan
from tests.rooms import ROOM, drive, laser, mirrored, scan_at
from tests.tsd.cases import default, error


@pytest.mark.parametrize("segments", [ROOM, mirrored(ROOM)])
@pytest.mark.parametrize("motion", [(0.04, 0.02, 0.03), (-0.05, -0.01, -0.02)])
@pytest.mark.parametrize("mount", [IDENTITY, Pose2(0.2, -0.1, 0.7)])
def test_a_known_motion_is_found(segments, motion, mount):
    lidar = laser(361, mount=mount)
    slam = default()
    slam.update(scan_at((0.0, 0.0, 0.0), lidar, segments))
    found = slam.update(scan_at(motion, lidar, segments, t=0.1))
    distance, turn = error(motion, found)
    assert distance < 1e-3 and turn < 2e-4


def test_mirrored_world_mirrored_poses():
    flip = np.array([1.0, -1.0, -1.0])
    a, b = default(), default()
    for pose in np.linspace((0.0, 0.0, 0.0), (0.5, 0.3, 0.4), 12):
        p = a.update(scan_at(pose))
        q = b.update(scan_at(pose * flip, segments=mirrored(ROOM)))
        assert np.array(p) * flip == pytest.approx(np.array(q), abs=1e-6)


def test_drive_is_accurate_without_odometry():
    log = drive(n=150, odometry=False, gyro=False)
    run = replay(default(), log)
    truth = log.truth_at(log.t)
    errors = np.array(
        [
            error(Pose2(*truth[0]).between(Pose2(*p)), q)
            for p, q in zip(truth, run.poses, strict=True)
        ]
    )
    assert errors[:, 0].mean() < 0.003 and errors[:, 0].max() < 0.01
    assert errors[:, 1].mean() < 0.001


def test_covariance_is_that_of_the_poses():
    lidar, rng = laser(361), np.random.default_rng(0)
    slam = default(push_translation=10.0, push_rotation=3.0)
    slam.update(scan_at((0.0, 0.0, 0.0), lidar))
    poses = []
    for i in range(60):
        poses.append(slam.update(scan_at((0.0, 0.0, 0.0), lidar, noise=0.01, rng=rng, t=0.1 * i)))
    ratio = np.sqrt(np.diag(slam.covariance)) / np.std(poses, axis=0)
    assert (ratio > 0.4).all() and (ratio < 2.5).all()
    assert 0.9 < slam.quality <= 1.0


def test_robocup(shared_data):
    log = load(shared_data("data/robocup/robocup.npz")).select(400, odometry=False)
    run = replay(default(), log)
    truth = log.truth_at(log.t)
    errors = [
        error(Pose2(*truth[0]).between(Pose2(*p)), q) for p, q in zip(truth, run.poses, strict=True)
    ]
    assert np.mean(errors, axis=0)[0] < 0.0025 and np.mean(errors, axis=0)[1] < 0.001


def test_scans_that_were_lost_on_the_way_change_nothing():
    log = drive(n=120, odometry=False, gyro=False)
    truth, slam = log.truth_at(log.t), default()
    kept = [i for i in range(120) if i < 30 or i % 4 == 0]
    for i, scan in ((i, scan) for i, scan in enumerate(log) if i in kept):
        found = slam.update(scan)
        step = Pose2(*truth[0]).between(Pose2(*truth[i]))
        assert error(step, found)[0] < 0.01, i
    assert slam.report()["predicted"] == slam.report()["lost"] == 0


def test_a_slow_sweep_is_read_again_with_the_velocity_that_was_found():
    lidar = laser(361, time_increment=0.19 / 361)
    log = drive(n=60, rate=5.0, lidar=lidar, odometry=False, gyro=False)
    truth, errors = log.truth_at(log.t), []
    steps = [Pose2(*a).between(Pose2(*b)) for a, b in pairwise(truth)]
    for deskew in (True, False):
        found = [Pose2(*p) for p in replay(default(deskew=deskew), log).poses]
        made = zip(pairwise(found), steps, strict=True)
        errors.append(np.mean([error(a.between(b), s)[0] for (a, b), s in made]))
    assert errors[0] < 0.8 * errors[1]


def test_odometry_that_stalls_and_jumps_is_overruled():
    log = drive(n=60, gyro=False)
    truth, slam = log.truth_at(log.t), default()
    held = None
    for i, (p, scan) in enumerate(zip(truth, log, strict=True)):
        held = held if 20 <= i < 40 and held is not None else scan.odometry
        jumped = Pose2(1.2, 0.0, 0.0) @ held if i >= 50 else held
        found = slam.update(Scan(scan.t, scan.ranges, scan.laser, jumped))
        distance, turn = error(Pose2(*truth[0]).between(Pose2(*p)), found)
        assert distance < 0.02 and turn < 0.01, i
    assert slam.report()["lost"] == 0
