"""The particle filter of gmapping: who is reported, how far the others are, what is drawn."""

import dataclasses

import numpy as np
import pytest

from gmapping.render_kernels import Counts, draw
from slams.types import Pose2
from tests.gmapping.scenes import (
    drive,
    run,
)


def test_the_reported_particle_stays_at_its_peak_and_the_others_are_drawn():
    _, scans = drive(50)
    one, poses = run(scans, n_particles=1)
    many, reported = run(scans, n_particles=6)
    assert many.report()["resampled"] == 0  # no old ground
    np.testing.assert_allclose(reported, poses, atol=1e-9)
    others = np.delete(many.particles.poses, many.particles.best, axis=0)
    off = np.hypot(*(others[:, :2] - one.particles.poses[0, :2]).T)
    assert 1e-4 < off.max() < 0.05 and len(np.unique(off)) == len(off)
    full = run(scans, "paper", n_particles=1)[1]
    assert not np.array_equal(full, run(scans, "paper", n_particles=1, seed=3)[1])


def test_beams_clear_what_they_cross_and_mark_their_end():
    hits, visits, walls = (np.zeros(shape, np.int32) for shape in ((3, 7), (3, 7), (1, 2)))
    counts = Counts(hits, visits, walls, 0, 0, 0.05)
    ends, sensor = np.array([[0.30, 0.05], [0.0, 0.10]]), np.array([0.0, 0.05])
    draw(ends, sensor, counts, 1)
    np.testing.assert_array_equal(visits, [[0] * 7, [2, 1, 1, 1, 1, 1, 1], [1] + [0] * 6])
    np.testing.assert_array_equal(hits, [[0] * 7, [0] * 6 + [1], [1] + [0] * 6])
    np.testing.assert_array_equal(walls, [[1, 1]])
    draw(ends, sensor, counts, -1)
    assert not (hits.any() or visits.any() or walls.any())


def test_a_closed_loop_moves_the_robot_and_is_no_motion():
    _, scans = drive(30)
    (slam, poses), (other, _) = (run(scans[:-1], n_particles=2) for _ in range(2))
    particles, pose = slam.particles, Pose2(*poses[-1])
    particles.poses[:] = pose
    particles.poses[0, 1] += 0.3
    particles.best, particles.lifetime[:] = 0, [0.0, 90.0]
    assert slam._elect(pose, np.array([False, True])) == pose and particles.best == 0
    there = slam._elect(pose, np.array([True, True]))
    assert (slam.report()["closed"], slam.report()["switched"], particles.best) == (1, 0, 0)
    np.testing.assert_allclose(there, [pose.x, pose.y + 0.3, pose.theta])
    shifted, expected = (s._estimator.predict(scans[-1]).pose for s in (slam, other))
    np.testing.assert_allclose(shifted, [expected.x, expected.y + 0.3, expected.theta], atol=1e-4)


def test_without_odometry_the_original_needs_one_particle_and_enters_every_scan():
    scans = [dataclasses.replace(scan, odometry=None) for scan in drive(40)[1]]
    report = run(scans, "original")[0].report()
    assert (report["particles"], report["inserted"]) == (1, 40)


def test_the_papers_filter_reports_the_leader_whether_or_not_it_has_closed_a_loop():
    _, scans = drive(10)
    slam, poses = run(scans, "paper", n_particles=2)
    slam.particles.best, slam.particles.lifetime[:] = 0, [0.0, 1.0]
    slam._elect(Pose2(*poses[-1]), np.array([False, False]))
    assert slam.particles.best == 1


def test_particles_spread_as_the_pose_becomes_less_certain():
    slam, _ = run(drive(12)[1], n_particles=2)
    way, before = Pose2(0.2, 0.0, 0.0), slam._estimator.covariance
    certain = np.linalg.inv(slam._information(way)[0])
    lost = np.diag([0.09, 0.0, 0.0])
    slam._known = before - lost
    np.testing.assert_allclose(np.linalg.inv(slam._information(way)[0]), certain + lost, atol=1e-5)
    slam._known = before + lost  # more certain: no less than the noise of the way
    noise = slam.params.key_noise + slam.params.way_noise * 0.2
    assert certain[0, 0] == pytest.approx(noise**2, rel=0.5)
    np.testing.assert_allclose(np.linalg.inv(slam._information(way)[0])[0, 0], noise**2)
