"""tsd: kernels against naive twins and analytic fields, recovery, both presets."""

import math

import numpy as np
import pytest

from slams.geometry import solve3
from slams.player import replay
from slams.scanlog import load
from slams.types import IDENTITY, Pose2
from tests import naive_tsd
from tests.rooms import ROOM, box, cast, drive, laser, mirrored, scan_at
from tsd import Tsd, TsdParams
from tsd.field_kernels import facing, layer_mask, read_field
from tsd.grid import TsdGrid, zero_crossings
from tsd.grid_kernels import Sensor, cast_rays, mask_scan
from tsd.icp_kernels import Buckets, closed_form, fill_buckets, nearest
from tsd.ransac_kernels import make_hypothesis, oriented_normals, score_pdf
from tsd.surface_kernels import Beams, Twist, find_hits, fit_line, sum_moments

PLANE = np.array([(-50.0, 2.0, 50.0, 2.0)])
CORNER = np.array([(-3.0, 2.0, 3.0, 2.0), (3.0, 2.0, 3.0, -2.0), (3.0, -2.0, -3.0, -2.0)])


def default(**changes):
    return Tsd(TsdParams().replace(**changes))


def original(**changes):
    return Tsd(TsdParams.preset("original").replace(map_size=9, **changes))


def error(a, b):
    step = Pose2(*a).between(Pose2(*b))
    return math.hypot(step.x, step.y), abs(step.theta)


def field_at(slam, x, y, normal):
    return read_field(slam._registration._field.kernel, facing(*normal), x, y)


@pytest.mark.parametrize("heading", [0.0, 0.4, 0.785])
def test_a_plane_has_its_analytic_distances(heading):
    slam = default()
    slam.update(scan_at((0.0, 0.0, heading), laser(721), PLANE))
    map_from_world = Pose2(0.0, 0.0, heading).inverse()
    normal = map_from_world.transform(np.array([[0.0, -1.0]]))[0]
    for x in np.linspace(-1.5, 1.5, 13):
        for sd in (-0.03, 0.0, 0.03, 0.06):
            point = map_from_world.transform(np.array([[x, 2.0 - sd]]))[0]
            value, gx, gy = field_at(slam, *point, normal)
            assert value == pytest.approx(sd, abs=1e-3)
            assert (gx, gy) == pytest.approx(tuple(normal), abs=0.02)


def test_a_corner_keeps_each_wall_in_its_own_layer():
    slam = default()
    slam.update(scan_at((0.0, 0.0, 0.0), laser(721), CORNER))
    for t in (0.2, 0.5):
        for sd in (-0.05, 0.05):
            assert field_at(slam, 3.0 - t, 2.0 - sd, (0, -1))[0] == pytest.approx(sd, abs=2e-3)
            assert field_at(slam, 3.0 - sd, 2.0 - t, (-1, 0))[0] == pytest.approx(sd, abs=2e-3)


def test_both_sides_of_a_thin_plate_stay_where_they_are():
    plate = np.array([*box(-0.5, 1.0, 0.5, 1.02), *box(-4.0, -3.0, 4.0, 3.0)])
    slam = default()
    rng = np.random.default_rng(1)
    path = [(1.6 * math.sin(a), 1.0 - 1.6 * math.cos(a), a) for a in np.linspace(0, 6.2, 250)]
    first = Pose2(*path[0])
    for i, pose in enumerate(path):
        found = slam.update(scan_at(pose, laser(721), plate, 0.01, rng, 0.05 * i))
        distance, turn = error(first.between(Pose2(*pose)), found)
        assert distance < 0.01 and turn < 0.005
    for sd in (-0.03, 0.0, 0.05):
        low = first.inverse().transform(np.array([[0.0, 1.0 - sd]]))[0]
        high = first.inverse().transform(np.array([[0.0, 1.02 + sd]]))[0]
        assert field_at(slam, *low, (0, -1))[0] == pytest.approx(sd, abs=0.006)
        assert field_at(slam, *high, (0, 1))[0] == pytest.approx(sd, abs=0.006)


def test_layers_cover_every_direction_and_never_opposite_sides():
    for angle in np.linspace(-np.pi, np.pi, 181):
        n = (math.cos(angle), math.sin(angle))
        mask = layer_mask(*n)
        assert mask >> facing(*n) & 1
        assert not mask & layer_mask(-n[0], -n[1])


def test_line_fit_is_total_least_squares():
    rng = np.random.default_rng(0)
    for turn in np.linspace(0.0, 3.0, 7):
        t = np.linspace(-0.2, 0.3, 20)
        points = np.stack([t * math.cos(turn) + 2.0, t * math.sin(turn) - 1.0], axis=1)
        points += rng.normal(0.0, 0.005, points.shape)
        sums = np.zeros((21, 5))
        sum_moments(np.column_stack([points, np.zeros((20, 2))]), 20, sums)
        x, y, nx, ny, variance = fit_line(sums, 0, 20)
        center, normal = naive_tsd.line_of(points)
        assert (x, y) == pytest.approx(tuple(center))
        assert abs(nx * normal[0] + ny * normal[1]) == pytest.approx(1.0, abs=1e-6)
        offsets = (points - center) @ normal
        assert variance == pytest.approx((offsets**2).sum() / 18, rel=1e-6)


def test_gradient_is_the_interpolants():
    slam = default()
    for scan in drive(n=30, lidar=laser(361)):
        slam.update(scan)
    kernel = slam._registration._field.kernel
    rng = np.random.default_rng(2)
    checked = 0
    for _ in range(12000):
        x, y = rng.uniform(-4.5, 4.5, 2)
        layer, h = int(rng.integers(4)), 1e-5
        value, gx, gy = read_field(kernel, layer, x, y)
        around = [
            read_field(kernel, layer, x + a, y + b)[0]
            for a, b in ((h, 0), (-h, 0), (0, h), (0, -h))
        ]
        if np.isfinite([value, *around]).all():
            checked += 1
            assert gx == pytest.approx((around[0] - around[1]) / (2 * h), abs=1e-2)
            assert gy == pytest.approx((around[2] - around[3]) / (2 * h), abs=1e-2)
    assert checked > 50


def test_cholesky_solves():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(3, 3))
    H, b, dx = A @ A.T + np.eye(3), rng.normal(size=3), np.zeros(3)
    assert solve3(H, b, dx)
    assert dx == pytest.approx(np.linalg.solve(H, b))
    assert not solve3(np.ones((3, 3)), b, dx)


@pytest.mark.parametrize("segments", [ROOM, mirrored(ROOM)])
@pytest.mark.parametrize("motion", [(0.04, 0.02, 0.03), (-0.05, -0.01, -0.02)])
@pytest.mark.parametrize("mount", [IDENTITY, Pose2(0.2, -0.1, 0.7)])
def test_a_known_motion_is_found(segments, motion, mount):
    lidar = laser(361, mount=mount)
    slam = default()
    slam.update(scan_at((0.0, 0.0, 0.0), lidar, segments))
    found = slam.update(scan_at(motion, lidar, segments, t=0.1))
    distance, turn = error(motion, found)
    assert distance < 6e-3 and turn < 2e-3


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


def test_hits_of_a_moving_laser_lie_on_the_walls():
    lidar = laser(181, time_increment=0.1 / 181)
    twist, walls = Twist(0.6, -0.2, 0.9), np.array(box(-3.0, -2.0, 2.0, 3.0))
    ranges = np.empty(181, np.float32)
    for i in range(181):
        t = (i - 90) * lidar.time_increment
        turn = twist.omega * t
        pose = Pose2(twist.vx * t, twist.vy * t, turn)
        one = laser(1)
        ranges[i] = cast(walls, pose @ Pose2(0.0, 0.0, lidar.angles[i] - one.angles[0]), one)[0]
    ranges.flags.writeable = False
    beams = Beams(
        lidar.directions,
        0.0,
        0.0,
        0.0,
        lidar.angle_min,
        lidar.angle_increment,
        0.1,
        30.0,
        lidar.time_increment,
    )
    hits = np.zeros((181, 4))
    assert find_hits(ranges, beams, twist, hits) == 181
    x, y = hits[:, 0], hits[:, 1]
    off = np.min(np.abs([x + 3.0, x - 2.0, y + 2.0, y - 3.0]), axis=0)
    assert off.max() < 1e-5
    find_hits(ranges, beams, Twist(0.0, 0.0, 0.0), hits)
    x, y = hits[:, 0], hits[:, 1]
    assert np.min(np.abs([x + 3.0, x - 2.0, y + 2.0, y - 3.0]), axis=0).max() > 0.02


def test_a_laser_that_takes_time_is_followed():
    log = drive(n=60, lidar=laser(181, time_increment=0.04 / 181), odometry=False, gyro=False)
    run = replay(default(), log)
    truth = log.truth_at(log.t)
    first = len(log) // 3
    errors = [
        error(Pose2(*truth[first]).between(Pose2(*p)), Pose2(*run.poses[first]).between(Pose2(*q)))
        for p, q in zip(truth[first:], run.poses[first:], strict=True)
    ]
    assert np.max(errors, axis=0)[0] < 0.02 and np.max(errors, axis=0)[1] < 0.01


def test_kidnapped_within_view():
    rng = np.random.default_rng(5)
    lidar = laser(361)
    recovered = 0
    for _ in range(200):
        start = np.array([*rng.uniform((-1.5, -1.0), (1.5, 1.0)), rng.uniform(-3, 3)])
        slam = default()
        for i in range(3):
            slam.update(scan_at(start, lidar, noise=0.01, rng=rng, t=0.05 * i))
        radius, side = 0.5 * math.sqrt(rng.random()), rng.uniform(-np.pi, np.pi)
        jump = Pose2(
            radius * math.cos(side), radius * math.sin(side), rng.uniform(-1, 1) * math.radians(30)
        )
        moved = Pose2(*start) @ jump
        for i in range(3):
            found = slam.update(scan_at(moved, lidar, noise=0.01, rng=rng, t=0.2 + 0.05 * i))
        distance, turn = error(jump, found)
        recovered += distance < 0.02 and turn < 0.01
    assert recovered >= 190


def test_a_scan_that_fits_nowhere_is_refused_and_not_pushed():
    slam = default()
    for i in range(5):
        slam.update(scan_at((0.0, 0.0, 0.0), t=0.1 * i))
    before = slam.report()["pushed"]
    elsewhere = np.array(box(-0.6, -0.7, 0.4, 0.9))
    pose = slam.update(scan_at((0.0, 0.0, 0.2), segments=elsewhere, t=0.6))
    assert error(IDENTITY, pose)[0] < 0.05
    report = slam.report()
    assert (report["rejected"], report["lost"], report["pushed"]) == (1, 1, before)
    slam.update(scan_at((0.0, 0.0, 0.0), t=0.7))
    assert slam.report()["recovered"] == 1


def test_a_wall_that_went_away_is_erased():
    room, wall = np.array(box(-3.0, -3.0, 3.0, 3.0)), np.array([(1.0, -0.5, 1.0, 0.5)])
    slam = default(push_translation=0.0, push_rotation=0.0)
    for i in range(5):
        slam.update(scan_at((0.0, 0.0, 0.0), segments=np.vstack([room, wall]), t=0.1 * i))
    assert occupied(slam, 1.0, 0.0)
    for i in range(20):
        slam.update(scan_at((0.0, 0.0, 0.001 * (i % 2)), segments=room, t=1.0 + 0.1 * i))
    assert not occupied(slam, 1.0, 0.0)
    assert occupied(slam, 3.0, 0.0)


def occupied(slam, x, y):
    grid = slam.map()
    ix = int((x - grid.origin[0]) / grid.resolution)
    iy = int((y - grid.origin[1]) / grid.resolution)
    return bool(np.nanmax(grid.p[iy - 1 : iy + 2, ix - 1 : ix + 2]) > 0.5)


@pytest.mark.parametrize("make", [default, original])
def test_map_and_field_show_the_room(make):
    slam = make()
    for scan in drive(n=25, gyro=False):
        slam.update(scan)
    x0, y0, _ = -1 * np.array(drive(n=1).truth_at(np.zeros(1))[0])
    assert occupied(slam, 5.0 + x0, y0) and occupied(slam, x0, -3.0 + y0)
    grid = slam.map()
    ix, iy = (np.array([0.5, 0.5]) - grid.origin) / grid.resolution
    assert grid.p[int(iy), int(ix)] < 0.5
    tsd, weight, resolution, origin = slam.field()
    assert tsd.shape == weight.shape == grid.p.shape
    assert (resolution, origin) == (grid.resolution, grid.origin)
    assert np.isfinite(tsd[weight > 0]).all()


def test_zero_crossings_take_the_nearer_cell():
    tsd = np.array([[0.9, 0.3, -0.7, np.nan, 0.2]], np.float32)
    assert zero_crossings(tsd).tolist() == [[False, True, False, False, False]]


def small_grid(pose, ranges, sensor):
    grid = TsdGrid(0.05, 0.15, 128, True)
    mask = np.ones(len(ranges), np.bool_)
    grid.push(np.array(pose), ranges, mask, sensor)
    return grid.kernel


@pytest.fixture(scope="module")
def pushed():
    lidar = laser(541)
    sensor = Sensor(lidar.angle_min, lidar.angle_increment, 0.001, 30.0, 2.0, 32.0, 0.01)
    pose, walls = (0.1, -0.2, 0.3), np.array(box(-2.0, -2.2, 2.3, 2.0))
    ranges = cast(walls, pose, lidar)
    return small_grid(pose, ranges, sensor), sensor, pose, ranges, lidar


def test_push_equals_the_naive_twin(pushed):
    kernel, _, pose, ranges, lidar = pushed
    twin = naive_tsd.push_once(
        kernel.tsd.shape, kernel.corner, kernel.cell, 0.15, pose, ranges, lidar.angles, 0.01
    )
    cells = np.kron(kernel.allocated, np.ones((32, 32), bool))
    assert cells.sum() > 4000
    assert np.allclose(kernel.tsd[cells], twin[cells], atol=1e-5, equal_nan=True)


def test_ray_cast_equals_the_naive_twin_and_the_walls(pushed):
    kernel, sensor, pose, ranges, lidar = pushed
    points, mask = np.zeros((541, 2)), np.zeros(541, np.bool_)
    assert cast_rays(kernel, np.array(pose), sensor, points, mask) == mask.sum() > 400
    for i in np.flatnonzero(mask)[::20]:
        angle = lidar.angles[i] + pose[2]
        twin = naive_tsd.cast_ray(
            kernel.tsd, kernel.corner, 0.05, pose, (math.cos(angle), math.sin(angle)), 4.0
        )
        assert math.hypot(*points[i]) == pytest.approx(twin, abs=2e-3)
    assert np.median(np.abs(np.hypot(*points[mask].T) - ranges[mask])) < 2e-3


def test_mask_drops_short_jumps_and_nan():
    lidar = laser(9, fov=0.08)
    sensor = Sensor(lidar.angle_min, lidar.angle_increment, 0.001, 30.0, 2.0, 32.0, 0.01)
    ranges = np.array([2.0, 2.0, 5.0, 5.0, np.inf, np.nan, 0.1, 2.0, 2.0], np.float32)
    ranges.flags.writeable = False
    out, mask = np.zeros(9), np.zeros(9, np.bool_)
    mask_scan(ranges, sensor, 0.26, math.radians(3), out, mask)
    assert mask.tolist() == [True, True, False, True, True, False, False, False, True]
    assert math.isinf(out[5]) and out[6] == 0.0


def test_nearest_equals_the_naive_twin():
    rng = np.random.default_rng(0)
    points = rng.uniform(-3, 4, (200, 2))
    buckets = Buckets(
        np.zeros((64, 64), np.int32), np.zeros(200, np.int64), points, np.zeros(3), 0.05
    )
    fill_buckets(buckets, 200)
    for query in rng.uniform(-4, 5, (300, 2)):
        for hint in (-1, 7):
            found, d2 = nearest(buckets, query[0], query[1], 0.4, hint)
            twin = naive_tsd.nearest(points, query, 0.4)
            assert found == twin
            if twin >= 0:
                assert math.sqrt(d2) == pytest.approx(np.hypot(*(points[twin] - query)))


def test_closed_form_finds_the_motion():
    rng = np.random.default_rng(3)
    scene, motion = rng.uniform(-2, 2, (30, 2)), Pose2(0.2, -0.1, 0.4)
    pairs, found = closed_form(motion.transform(scene), scene, np.arange(30), 30)
    assert pairs == 30
    assert found == pytest.approx(np.array(motion))
    assert closed_form(scene, scene, np.full(30, -1), 30)[0] == 0


def test_hypothesis_lays_point_on_point_and_normal_on_normal():
    motion = np.zeros(3)
    model, scene = np.array([1.0, 2.0]), np.array([0.5, -0.3])
    assert make_hypothesis(model, 0.5, scene, 0.2, 0.8, motion)
    assert Pose2(*motion).transform(scene[None])[0] == pytest.approx(model)
    assert motion[2] == pytest.approx(0.3)
    assert not make_hypothesis(model, 2.0, scene, 0.2, 0.8, motion)


def test_score_equals_the_naive_twin(pushed):
    kernel, _, pose, ranges, lidar = pushed
    points = (ranges[:, None] * lidar.directions)[::30]
    for motion in ((0.0, 0.0, 0.0), (0.03, -0.02, 0.01), (0.5, 0.0, 0.0)):
        twin = naive_tsd.pdf_score(kernel.tsd, kernel.corner, 0.05, points, motion, pose, 0.05)
        score = score_pdf(
            kernel,
            np.column_stack([points, points[:, 0]]),
            len(points),
            np.array(motion),
            np.array(pose),
            0.05,
            0.0,
        )
        assert score == pytest.approx(twin, rel=1e-4)


def test_normals_face_the_laser_and_corners_have_none():
    lidar = laser(361)
    points = cast(np.array(box(-2.0, -2.0, 2.0, 2.0)), (0, 0, 0), lidar)[:, None] * lidar.directions
    phi = np.zeros(361)
    oriented_normals(points, np.ones(361, np.bool_), phi)
    assert phi[180] == pytest.approx(math.pi) or phi[180] == pytest.approx(-math.pi)
    corner = int(np.argmin(np.abs(lidar.angles - math.pi / 4)))
    assert math.isnan(phi[corner]) and math.isnan(phi[0])


@pytest.mark.parametrize("mode", ["icp", "exp", "pdf", "tsd"])
def test_every_published_mode_follows_a_drive(mode):
    slam = original(registration=mode, trials=20)
    log = drive(n=12, odometry=False, gyro=False)
    truth = log.truth_at(log.t)
    for p, scan in zip(truth, log, strict=True):
        distance, turn = error(Pose2(*truth[0]).between(Pose2(*p)), slam.update(scan))
        assert distance < 0.03 and turn < 0.02


def test_pre_registration_bridges_a_turn_that_icp_does_not():
    turn = (0.1, 0.05, 0.4)
    found = {}
    for mode in ("icp", "tsd"):
        slam = original(registration=mode)
        slam.update(scan_at((0.0, 0.0, 0.0)))
        found[mode] = error(turn, slam.update(scan_at(turn, t=1.0)))[0]
    assert found["tsd"] < 0.03 < found["icp"]


def test_original_refuses_long_steps():
    slam = original(max_translation=0.01)
    slam.update(scan_at((0.0, 0.0, 0.0)))
    assert slam.update(scan_at((0.2, 0.0, 0.0), t=0.1)) == IDENTITY
    assert slam.report()["rejected"] == 1


@pytest.mark.parametrize("grows", [True, False])
def test_published_grid_grows_only_when_it_may(grows):
    original_params = TsdParams.preset("original")
    slam = Tsd(original_params.replace(map_size=6, grows=grows, registration="icp"))
    slam.update(scan_at((0.0, 0.0, 0.0)))
    assert (slam.map().p.shape[0] > 64) == grows


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
