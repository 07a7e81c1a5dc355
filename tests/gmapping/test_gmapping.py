import math

import numpy as np
import pytest

import slams
from gmapping import GMapping, GMappingParams
from gmapping.render_kernels import Counts, draw
from slams.types import IDENTITY, Laser, Pose2, Scan, wrap_angle
from tests.gmapping.scenes import (
    DATA,
    LASER,
    ROOM,
    cast,
    drive,
    make_scan,
    position_error,
    run,
)


def test_the_map_has_walls_where_the_room_has():
    _, scans = drive(40)
    grid = run(scans, n_particles=4)[0].map()
    x, y = grid.origin

    def p(px, py):
        return grid.p[int((py - y) / grid.resolution), int((px - x) / grid.resolution)]

    assert max(p(4.0, 0.5), p(3.96, 0.5), p(4.04, 0.5)) > 0.5
    assert p(1.0, 0.0) < 0.1
    assert np.isnan(grid.p).any()


# the whole filter


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


def test_odometry_that_freezes_and_catches_up_does_not_carry_the_pose_away():
    truth, scans = drive(80, noise=False)
    for i in range(40, 48):
        s = scans[i]
        scans[i] = Scan(s.t, s.ranges, s.laser, scans[40].odometry)
    jump = scans[48].odometry @ Pose2(0.4, 0.0, 0.5)
    tail = [jump @ scans[48].odometry.between(s.odometry) for s in scans[48:]]
    scans[48:] = [Scan(s.t, s.ranges, s.laser, o) for s, o in zip(scans[48:], tail, strict=True)]
    _, poses = run(scans, n_particles=3)
    assert position_error(poses, truth).max() < 0.05


# contract


def test_same_seed_same_poses_and_instances_do_not_meet():
    _, scans = drive(50)
    a = GMapping(GMappingParams(n_particles=4))
    b = GMapping(GMappingParams(n_particles=4, seed=9))
    mixed = np.array([(a.update(s), b.update(s))[0] for s in scans])
    alone, poses = run(scans, n_particles=4)
    np.testing.assert_array_equal(mixed, poses)
    np.testing.assert_array_equal(a.particles.poses, alone.particles.poses)
    assert not np.array_equal(a.particles.poses, b.particles.poses)


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


def test_the_odometry_frame_is_arbitrary():
    _, scans = drive(50)
    shift = Pose2(100.0, -40.0, 2.0)
    other = [Scan(s.t, s.ranges, s.laser, shift @ s.odometry) for s in scans]
    for preset in ("default", "original"):
        a, b = (run(x, preset, n_particles=3)[1] for x in (scans, other))
        np.testing.assert_allclose(a, b, atol=1e-6)


@pytest.mark.parametrize("preset", ["default", "paper", "original"])
def test_bad_data_leaves_a_finite_pose(preset):
    _, scans = drive(30)
    one = Laser(0.0, 0.1, 1, 0.1, 30.0)
    wide = Laser(-math.pi, math.radians(0.5), 720, 0.1, 30.0)
    nan, inf = np.full(361, np.nan, np.float32), np.full(361, np.inf, np.float32)
    odd = [
        Scan(0.0, nan, LASER),
        *scans[:10],
        Scan(1.0, inf, LASER, scans[10].odometry),
        Scan(0.2, nan, LASER),
        Scan(0.2, np.ones(1, np.float32), one, Pose2(math.nan, 0.0, 0.0)),
        Scan(0.2, np.zeros(361, np.float32), LASER, Pose2(1e9, 0.0, 0.0)),
        make_scan(IDENTITY, -5.0, wide),
        *scans[10:],
    ]
    slam, poses = run(odd, preset, n_particles=2)
    np.testing.assert_array_equal(poses[0], 0.0)
    assert np.isfinite(poses).all()
    assert np.abs(poses).max() < 3.2
    assert preset != "original" or slam.report()["rejected"] >= 4
    assert slam.map().p.size > 0
    assert preset == "original" or slam.covariance.shape == (3, 3)


def test_a_first_scan_without_points_leaves_the_odometry_in_force():
    truth, scans = drive(40, drift=0.0)
    blind = [
        Scan(s.t, np.full(361, np.nan, np.float32), s.laser, s.odometry) if i < 20 else s
        for i, s in enumerate(scans)
    ]
    assert position_error(run(blind, n_particles=2)[1], truth).max() < 0.02


def test_a_map_before_any_scan_is_empty():
    assert np.isnan(GMapping(GMappingParams()).map().p).all()


# real and simulated logs


@pytest.mark.skipif(not DATA.exists(), reason="the data folder is absent")
def test_accuracy_on_a_simulated_log():
    log = slams.load(DATA / "robocup" / "robocup.npz").select(500)
    poses = slams.replay(GMapping(GMappingParams(n_particles=10)), log).poses
    truth = [Pose2(*p) for p in log.truth_at(log.t)]
    step = [truth[i - 40].between(truth[i]) for i in range(40, 500)]
    mine = [Pose2(*poses[i - 40]).between(Pose2(*poses[i])) for i in range(40, 500)]
    error = [a.between(b) for a, b in zip(step, mine, strict=True)]
    assert np.mean([math.hypot(e.x, e.y) for e in error]) < 0.0022
    assert np.mean([abs(wrap_angle(e.theta)) for e in error]) < 0.0007


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
    particles.poses[1, 1] += 0.3
    particles.best, particles.lifetime[:] = 0, [0.0, slam.params.switch_margin - 1.0]
    assert slam._elect(pose) == pose and slam.report()["closed"] == 0
    particles.lifetime[1] += 2.0
    particles.poses[1, 1] -= 0.27  # no farther than draws go
    assert slam._elect(pose) == pose and particles.best == 0
    particles.poses[1, 1] += 0.27
    there = slam._elect(pose)
    assert slam.report()["closed"] == slam.report()["switched"] == 1
    np.testing.assert_allclose(there, [pose.x, pose.y + 0.3, pose.theta])
    shifted, expected = (s._estimator.predict(scans[-1]).pose for s in (slam, other))
    np.testing.assert_allclose(shifted, [expected.x, expected.y + 0.3, expected.theta], atol=1e-4)


def test_the_papers_filter_reports_the_leader_however_near_it_is():
    _, scans = drive(10)
    slam, poses = run(scans, "paper", n_particles=2)
    slam.particles.poses[:] = poses[-1]
    slam.particles.best, slam.particles.lifetime[:] = 0, [0.0, slam.params.switch_margin + 1.0]
    slam._elect(Pose2(*poses[-1]))
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
