import math

import numpy as np
import pytest

from gmapping import GMapping, GMappingParams
from gmapping.render_kernels import Counts, draw
from slams.types import Laser, Pose2, Scan
from tests.gmapping.scenes import (
    LASER,
    ROOM,
    cast,
    drive,
    make_scan,
    position_error,
    run,
)


@pytest.mark.parametrize("wheels", [True, False])
@pytest.mark.parametrize("gyro", [True, False])
def test_every_odometry_tracks(wheels, gyro):
    truth, scans = drive(120, gyro=True)
    slam, poses = run(scans, n_particles=5, wheels=wheels, gyro=gyro)
    error = position_error(poses, truth)
    assert error.max() < 0.03 and error.mean() < 0.008
    report = slam.report()
    assert report["odometry"] == (119 if wheels else 0)


def test_the_original_corrects_odometry_and_without_it_needs_one_particle():
    truth, scans = drive(120, drift=0.1)
    slam, poses = run(scans, "original", n_particles=8, linear_update=0.3)
    wheels = np.array([scans[0].odometry.between(s.odometry) for s in scans])
    assert position_error(poses, truth)[-1] < 0.6 * position_error(wheels, truth)[-1]
    truth, scans = drive(40, odometry=False)
    slam, poses = run(scans, "original")
    assert slam.report()["particles"] == 1
    assert slam.report()["inserted"] == 40
    assert position_error(poses, truth).max() < 0.1


def swept(at, t, laser):
    """A scan whose beams follow one another while the base moves; at(t) is the base's pose."""
    ranges = np.zeros(laser.n_beams, np.float32)
    for i, angle in enumerate(laser.angles):
        beam = Laser(angle, 0.0, 1, 0.1, 30.0)
        ranges[i] = cast(at(t + i * laser.time_increment), beam)[0]
    ranges.flags.writeable = False
    return Scan(t, ranges, laser)


def test_a_slow_sweep_is_seen_again_with_the_motion_that_was_found():
    laser = Laser(-math.pi, math.radians(2.0), 180, 0.1, 30.0, time_increment=0.2 / 180)

    def at(t):  # from rest along an arc
        return Pose2(0.0, 0.0, 0.3 * t * t / 2) @ Pose2(0.15 * t * t, 0.0, 0.0)

    times = 0.2 * np.arange(16)
    _, poses = run([swept(at, t, laser) for t in times], n_particles=2)
    truth = np.array([at(t) for t in times])
    assert position_error(poses, truth).max() < 0.03
    assert np.abs(poses[:, 2] - truth[:, 2]).max() < 0.03


def test_a_mounted_laser_gives_the_pose_of_the_base():
    laser = Laser(
        LASER.angle_min, LASER.angle_increment, LASER.n_beams, 0.1, 30.0, Pose2(0.2, -0.1, 0.7)
    )
    truth, scans = drive(60, laser)
    assert position_error(run(scans, n_particles=3)[1], truth).max() < 0.03


def test_a_noisy_laser_is_not_taken_for_a_lost_robot():
    truth, scans = drive(80, noise=False)
    rng = np.random.default_rng(6)
    scans = [
        make_scan(p, s.t, LASER, rng, s.odometry, None, ROOM, 0.04)
        for p, s in zip(truth, scans, strict=True)
    ]
    slam, poses = run(scans, n_particles=2)
    assert slam._view.noise == pytest.approx(0.04, rel=0.2)
    assert slam.quality > 0.9
    assert slam.report()["searched"] < 8
    assert position_error(poses, truth).max() < 0.05


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


def test_a_map_before_any_scan_is_empty():
    assert np.isnan(GMapping(GMappingParams()).map().p).all()


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
