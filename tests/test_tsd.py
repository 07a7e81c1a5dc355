"""tsd: kernels against naive twins and analytic fields, recovery, both presets."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest

from slams import load
from slams.geometry import FREEDOM, solve3
from slams.player import replay
from slams.registry import create
from slams.types import IDENTITY, Pose2, Scan
from tests import naive_tsd
from tests.rooms import ROOM, box, cast, drive, laser, mirrored, scan_at
from tsd import Tsd, TsdParams
from tsd.evidence import GAIN, Match
from tsd.icp_kernels import IcpRule, find_pair, sum_pairs
from tsd.image import colored
from tsd.map import TileField, surface_cells
from tsd.map_kernels import (
    PASSED,
    PushRule,
    carve,
    facing,
    list_rows,
    place_lines,
    push_rows,
    read_field,
)
from tsd.match_kernels import FLAT, MatchRule, agreement_along, align, explain
from tsd.original import Original, OriginalParams
from tsd.original.map import TsdGrid, zero_crossings
from tsd.original.map_kernels import cast_rays
from tsd.original.match_kernels import Buckets, Links, closed_form, fill_buckets, nearest, pair_up
from tsd.original.ransac_kernels import (
    BeamModel,
    closest_beams,
    make_hypothesis,
    score_beams,
    score_pdf,
)
from tsd.original.scan_kernels import Sensor, mask_scan, oriented_normals
from tsd.picture import draw
from tsd.ransac_kernels import AGAINST, PairRule, score_pose, try_pairs
from tsd.scan_kernels import (
    Beams,
    SurfaceRule,
    Twist,
    find_hits,
    find_runs,
    fit_best_line,
    fit_line,
    fit_surfaces,
    sum_moments,
)

PLANE = np.array([(-50.0, 2.0, 50.0, 2.0)])
CORNER = np.array([(-3.0, 2.0, 3.0, 2.0), (3.0, 2.0, 3.0, -2.0), (3.0, -2.0, -3.0, -2.0)])


def default(**changes):
    return Tsd(TsdParams().replace(**changes))


def original(**changes):
    return Original(OriginalParams(map_size=9, **changes))


def error(a, b):
    step = Pose2(*a).between(Pose2(*b))
    return math.hypot(step.x, step.y), abs(step.theta)


def field_at(slam, x, y, normal):
    return read_field(slam._field.kernel, facing(*normal), x, y)


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


def layers_of(normal):
    field = TileField(0.05, 0.15, 100.0).kernel
    line, rows = np.array([[1.0, -2.0, *normal, 1.0, 2.0, 0.0]]), np.zeros((99, 4))
    n = list_rows(field, line, 1, PushRule(0.15, 100.0, 0.2), rows)
    return set(rows[:n, 1].astype(int))


def test_layers_cover_every_direction_and_never_opposite_sides():
    for angle in np.linspace(-np.pi, np.pi, 181):
        n = (math.cos(angle), math.sin(angle))
        layers = layers_of(n)
        assert facing(*n) in layers
        assert not layers & layers_of((-n[0], -n[1]))


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
    kernel = slam._field.kernel
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
    assert (report["rejected"], report["lost"], report["pushed"]) == (1, 0, before)
    assert slam.state == "predicted"
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
            found, d2, _ = nearest(buckets, query[0], query[1], 0.4, hint)
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


def test_original_knows_no_time_in_a_scan():
    """A sweep is registered once, as if all its beams were measured at the stamp."""
    slow = dataclasses.replace(laser(361), time_increment=0.0005)
    path = [Pose2(0.03 * i, 0.0, 0.02 * i) for i in range(8)]
    poses = []
    for lidar in (laser(361), slow):
        slam = original()
        poses.append([slam.update(scan_at(p, lidar, t=0.2 * i)) for i, p in enumerate(path)])
    assert poses[0] == poses[1]
    assert error(path[-1], poses[0][-1])[0] < 0.03


@pytest.mark.parametrize("grows", [True, False])
def test_published_grid_grows_only_when_it_may(grows):
    slam = Original(OriginalParams(map_size=6, grows=grows, registration="icp"))
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


def test_pairs_equal_the_naive_twin_while_the_scene_moves():
    rng = np.random.default_rng(4)
    model = rng.uniform(-2, 2, (300, 2))
    scene = model[rng.permutation(300)[:250]] + rng.normal(0.0, 0.03, (250, 2))
    buckets = Buckets(
        np.zeros((64, 64), np.int32), np.zeros(300, np.int64), model, np.zeros(3), 0.05
    )
    fill_buckets(buckets, 300)
    links = Links(
        np.full(250, -1), np.full(300, -1), np.zeros(300), np.full(250, -1.0), np.zeros((250, 2))
    )
    searched = 0
    for gate in (0.4, 0.3, 0.2, 0.1, 0.05):
        before = links.at.copy()
        pair_up(buckets, scene, 250, gate**2, links)
        searched += int((links.at != before).any(axis=1).sum())
        assert np.array_equal(links.partner, naive_tsd.matched_pairs(model, scene, gate))
        scene = Pose2(0.004, -0.003, 0.002).transform(scene)
    assert searched < 4 * 250  # most keep their nearest


def test_push_blends_every_line_into_its_cells():
    field = TileField(0.05, 0.15, 3.0)
    rule = PushRule(0.15, 3.0, 0.2)
    rng, rows = np.random.default_rng(6), np.zeros((999, 4))
    lines = np.array([[1.0, 0.02 * rng.normal(), -0.05 * k, 1.0, 0.9, 1.0, 0.0] for k in range(5)])
    lines[:, 2:4] /= np.hypot(lines[:, 2], lines[:, 3])[:, None]
    for k in range(5):
        n = list_rows(field.kernel, lines[k : k + 1], 1, rule, rows)
        push_rows(field.kernel, lines[k : k + 1], rows, n, rule)
    tsd, weight, _, corner = field.picture()
    for y in (-0.075, -0.025, 0.025, 0.075):
        iy, ix = int((y - corner[1]) / 0.05), int((1.01 - corner[0]) / 0.05)
        x = corner[0] + (ix + 0.5) * 0.05
        cell_y = corner[1] + (iy + 0.5) * 0.05
        value, total = naive_tsd.pushed_cell(lines[:, :5], x, cell_y, 0.15, 3.0)
        assert tsd[iy, ix] == pytest.approx(value, abs=1e-5)
        assert weight[iy, ix] == pytest.approx(total, rel=1e-5)


def test_a_sparse_line_is_not_continued_far_beyond_its_hit():
    field = TileField(0.05, 0.15, 100.0).kernel
    line = np.array([[2.0, 0.0, 0.0, 1.0, 0.2, 8.0, 0.0]])
    rows = np.zeros((999, 4))
    n = list_rows(field, line, 1, PushRule(0.15, 100.0, 0.2), rows)
    along = field.corner[0] + (rows[:n, 2] + 0.5) * 0.05
    assert 4 <= n <= 7 and np.abs(along - 2.0).max() <= 0.15


def test_carve_marks_what_every_beam_passes():
    field = TileField(0.05, 0.15, 100.0).kernel
    gap, laser_at = 0.01, np.array([0.3, -0.2])
    angles = -1.0 + gap * np.arange(200)
    ends = laser_at + 4.02 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    lines = np.column_stack([ends, np.zeros((200, 5))])
    carve(field, lines, 200, *laser_at, PushRule(0.15, 100.0, gap))
    twin = naive_tsd.passed(laser_at, ends, field.corner, 0.05, field.seen.shape)
    seen = (field.seen & PASSED) > 0
    assert not (seen & ~twin).any()
    assert (twin & ~seen).sum() < 0.02 * twin.sum()  # close by, not every beam is walked


def scanned(n=10, **changes):
    """A default that has seen a drive, and the last scan's elements."""
    slam = default(**changes)
    for scan in drive(n=n):
        slam.update(scan)
    view = slam._view
    return slam, view.elements[: view.count].copy()


def test_pose_score_equals_the_naive_twin_and_stops_when_it_cannot_win():
    slam, elements = scanned()
    kernel, rule, pose = slam._field.kernel, PairRule(0.6, 0.8, 0.15), np.array(slam._track.pose)
    for shift in ((0.0, 0.0, 0.0), (0.07, -0.04, 0.02), (0.5, 0.6, 0.4)):
        at = pose + shift
        twin = naive_tsd.pose_score(kernel, elements, at, 0.15, AGAINST)
        score = score_pose(kernel, elements, len(elements), at, rule, -np.inf)
        assert score == pytest.approx(twin, rel=1e-4, abs=1e-3)
    best = naive_tsd.pose_score(kernel, elements, pose, 0.15, AGAINST)
    assert best > 0.7 * len(elements)
    wrong = pose + np.array([0.5, 0.6, 0.4])
    assert score_pose(kernel, elements, len(elements), wrong, rule, best) <= best


def test_pairs_equal_the_naive_twin_within_the_limits():
    slam, elements = scanned()
    elements = np.ascontiguousarray(elements[::9])
    kernel, model = slam._field.kernel, slam._registration.cast(slam._track.pose)
    lines = model.points
    start = np.array(slam._track.pose @ Pose2(0.2, 0.1, 0.2))
    rule = PairRule(0.5, math.cos(0.4), 0.15)
    trials = np.flatnonzero(lines[:, 4])[::7]
    best = np.zeros((len(trials) + 1, 4))
    try_pairs(kernel, lines, trials, elements, len(elements), start, rule, best)
    for m, row in zip(trials, best, strict=False):
        scores = [0.0]
        for element in elements:
            pose = naive_tsd.pair_pose(lines[m], element)
            distance, turn = error(start, pose)
            if distance <= 0.5 and turn <= 0.4:
                scores.append(naive_tsd.pose_score(kernel, elements, pose, 0.15, AGAINST))
        assert row[3] == pytest.approx(max(scores), rel=1e-3, abs=1e-2)
    assert best[:-1, 3].max() > 0.7 * len(elements)
    distance, turn = error(slam._track.pose, best[best[:-1, 3].argmax(), :3])
    assert distance < 0.1 and turn < 0.05


def hits_of(ranges, lidar):
    """Hits (n, 4) of a standing laser."""
    beams = Beams(lidar.directions, 0.0, 0.0, 0.0, lidar.angle_increment, 0.1, 30.0, 0.0)
    hits = np.zeros((lidar.n_beams, 4))
    count = find_hits(ranges, beams, Twist(0.0, 0.0, 0.0), hits)
    return beams, hits, count


RULE = SurfaceRule(0.12, 0.01, 8.0, 0.02**2, 0.2, 0.15)


def test_runs_equal_the_naive_twin():
    lidar = laser(361)
    ranges = cast(ROOM, (0.3, -0.2, 0.5), lidar).copy()
    ranges[100:106] = np.inf
    ranges[200] = np.inf
    beams, hits, count = hits_of(ranges, lidar)
    runs = np.zeros((361, 2))
    find_runs(hits, count, beams, RULE, runs)
    x_y, r, i = hits[:count, :2], hits[:count, 2], hits[:count, 3]
    twin = naive_tsd.runs_of(x_y, r, i, lidar.angle_increment, 8.0, 0.01)
    assert runs[:count].tolist() == [list(map(float, run)) for run in twin]
    assert len({tuple(run) for run in twin}) > 3


def test_the_best_of_three_windows_lies_on_one_wall_only():
    t = np.arange(20) * 0.02
    points = np.concatenate(
        [np.stack([t - 0.4, 0.0 * t], axis=1), np.stack([0.0 * t, -t - 0.02], axis=1)]
    )
    sums = np.zeros((41, 5))
    sum_moments(np.column_stack([points, np.zeros((40, 2))]), 40, sums)
    for k, normal in ((17, (0.0, 1.0)), (18, (0.0, 1.0)), (21, (1.0, 0.0)), (22, (1.0, 0.0))):
        *_, nx, ny, variance = fit_best_line(sums, k, 4, 0, 40)
        assert abs(nx * normal[0] + ny * normal[1]) == pytest.approx(1.0, abs=1e-6)
        assert variance < 1e-10


def test_surface_elements_stand_for_their_beams():
    lidar = laser(1081)
    room = np.array(box(-2.0, -3.0, 4.0, 2.5))
    beams, hits, count = hits_of(cast(room, (0.0, 0.0, 0.0), lidar), lidar)
    runs, sums, out = np.zeros((1081, 2)), np.zeros((1082, 5)), np.zeros((1081, 6))
    find_runs(hits, count, beams, RULE, runs)
    sum_moments(hits, count, sums)
    n = fit_surfaces(hits, count, runs, sums, beams, RULE, 0.05, out)
    x, y, nx, ny, information, index = out[:n].T
    assert np.min(np.abs([x + 2.0, x - 4.0, y + 3.0, y - 2.5]), axis=0).max() < 1e-3
    assert (nx * x + ny * y < 0.0).all()  # towards the laser
    assert np.abs(np.hypot(nx, ny) - 1.0).max() < 1e-9
    assert (np.diff(index) > 0).all()
    wall = (np.abs(x - 4.0) < 1e-3) & (np.abs(y) < 1.0)  # at 4 m: a beam every 1.7 cm
    step = np.hypot(x, y) * lidar.angle_increment
    stride = np.maximum((0.05 / step).astype(int), 1)
    cosine = 4.0 / np.hypot(x, y)
    expected = stride / ((0.01 * cosine) ** 2 + (0.2 * step) ** 2)
    assert information[wall] == pytest.approx(expected[wall], rel=0.05)
    dense = fit_surfaces(hits, count, runs, sums, beams, RULE, 0.0, out)
    assert dense > 0.97 * count


def test_alignment_equals_gauss_newton_by_hand():
    slam, elements = scanned()
    rule = MatchRule(1, 1e-4, 1e-5, 0.03, 0.01)
    prior = np.diag([100.0, 200.0, 300.0]) + 20.0
    start = np.array(slam._track.pose) + np.array([0.02, -0.01, 0.01])
    found, room = start.copy(), np.zeros((5, 3))
    known = start + np.array([0.01, 0.02, -0.01])
    align(slam._field.kernel, elements, len(elements), known, prior, rule, found, room)
    H, b = np.zeros((3, 3)), np.zeros(3)
    for x, y, nx, ny, information, _ in elements:
        p = Pose2(*start).transform(np.array([[x, y]]))[0]
        n = Pose2(0.0, 0.0, start[2]).transform(np.array([[nx, ny]]))[0]
        v, *gradient = read_field(slam._field.kernel, facing(*n), *p)
        if math.isnan(v):
            continue
        if np.hypot(*gradient) > FLAT:
            n = np.array(gradient) / np.hypot(*gradient)
        lever = p - start[:2]
        J = np.array([n[0], n[1], n[1] * lever[0] - n[0] * lever[1]])
        w = 1.0 / (1.0 / information + 0.01**2) / (1.0 + (v / 0.09) ** 2) ** 2
        H, b = H + w * np.outer(J, J), b - w * J * v
    prior = prior * (FREEDOM + 3.0) / (FREEDOM + (known - start) @ prior @ (known - start))
    expected = np.linalg.solve(H + prior, b + prior @ (known - start))
    assert found - start == pytest.approx(expected, rel=1e-9)
    assert room[:3] == pytest.approx(H)


def test_agreement_along_equals_the_naive_twin():
    slam, elements = scanned()
    offsets = np.array([(0.0, 0.0), (0.1, 0.0), (-0.3, 0.2)])
    pose, rule = np.array(slam._track.pose), MatchRule(1, 1e-4, 1e-5, 0.03, 0.01)
    out = np.zeros((3, 2))
    kernel = slam._field.kernel
    agreement_along(kernel, elements, len(elements), slam._view.beams, pose, offsets, rule, out)
    twin = naive_tsd.agreement(kernel, elements, pose, offsets, 0.03)
    assert out == pytest.approx(np.array(twin), rel=1e-4, abs=1e-3)
    assert out[0, 1] > 0.9 * out[0, 0] and out[2, 1] < 0.8 * out[2, 0]


HALLWAY = [(-60.0, 1.0, 60.0, 1.0), (-60.0, -1.0, 60.0, -1.0)]
NICHES = [(-6.0, 0.96), (2.1, -1.0), (7.5, 0.96)]


def driven(segments, n_beams, with_odometry, slip=0.0, step=0.03):
    """Where a default is after 59 steps [m] along a corridor, slipped half way."""
    slam, lidar, rng = default(), laser(n_beams), np.random.default_rng(3)
    for i in range(60):
        at = Pose2(step * i, 0.0, 0.0)
        scan = scan_at(at, lidar, np.array(segments), noise=0.01, rng=rng, t=0.1 * i)
        if i == 30:
            slam._track.pose = slam._track.pose @ Pose2(slip, 0.0, 0.0)
            slam._track.covariance[0, 0] += slip * slip
        odometry = Pose2(at.x + 5.0, 0.0, 0.0) if with_odometry else None
        found = slam.update(Scan(scan.t, scan.ranges, scan.laser, odometry))
    return found.x


@pytest.mark.parametrize("n_beams", [181, 1081])
def test_a_bare_corridor_does_not_hold_the_robot(n_beams):
    assert driven(HALLWAY, n_beams, with_odometry=True) == pytest.approx(1.77, abs=0.2)


@pytest.mark.parametrize("n_beams", [181, 1081])
def test_niches_of_a_corridor_are_enough_without_odometry(n_beams):
    sides = [side for x, y in NICHES for side in box(x, y, x + 0.15, y + 0.04)]
    assert driven([*HALLWAY, *sides], n_beams, with_odometry=False) == pytest.approx(1.77, abs=0.2)


def test_niches_of_a_corridor_hold_a_robot_at_rest():
    sides = [side for x, y in NICHES for side in box(x, y, x + 0.15, y + 0.04)]
    assert abs(driven([*HALLWAY, *sides], 181, with_odometry=False, step=0.0)) < 0.15


def test_a_slip_along_a_corridor_is_taken_back():
    sides = [side for x, y in NICHES for side in box(x, y, x + 0.15, y + 0.04)]
    slipped = driven([*HALLWAY, *sides], 181, with_odometry=True, slip=-0.3)
    assert slipped == pytest.approx(1.77, abs=0.06)


def test_no_other_pose_is_taken_for_what_noise_prefers():
    slam, _ = scanned()
    evidence, pose = slam._evidence, slam._track.pose
    base = evidence.weigh(pose, np.zeros((3, 3)))
    for off, more, wins in ((0.02, 1.0, False), (0.2, 1.0, True), (0.2, 0.5 * GAIN, False)):
        other = base._replace(pose=pose @ Pose2(off, 0.0, 0.0), worth=base.worth + more)
        assert (evidence.best([base, other]) is other) == wins


def test_evidence_counts_what_is_explained_and_what_is_contradicted():
    slam, elements = scanned()
    evidence, pose = slam._evidence, slam._track.pose
    there = evidence.weigh(pose, np.zeros((3, 3)))
    assert there.close > 0.9 and there.known > 0.9
    values = []
    for x, y, nx, ny, *_ in elements:
        p = pose.transform(np.array([[x, y]]))[0]
        n = Pose2(0.0, 0.0, pose.theta).transform(np.array([[nx, ny]]))[0]
        values.append(read_field(slam._field.kernel, facing(*n), *p)[0])
    known = np.array(values)[np.isfinite(values)]
    assert there.known == pytest.approx(len(known) / len(elements))
    robust = evidence.robust
    assert there.close * len(elements) == pytest.approx((1 / (1 + (known / robust) ** 2)).sum())
    kernel, at = slam._field.kernel, np.array(pose @ Pose2(0.5, 0.4, 0.3))
    known, close, against, _ = explain(kernel, elements, len(elements), at, robust)
    assert against > 0.2 * len(elements)
    off = evidence.weigh(Pose2(*at), np.zeros((3, 3)))
    assert off.worth < (close - 0.4 * against) / len(elements)


def test_what_is_usual_falls_faster_when_nothing_better_was_found():
    slam, _ = scanned()
    evidence = slam._evidence
    poor = Match(IDENTITY, 1.0, 0.5, 0.5, 0.01, np.zeros((3, 3)))
    usual = evidence.usual
    evidence.learn(poor, searched=False)
    slowly = usual - evidence.usual
    evidence.usual = usual
    evidence.learn(poor, searched=True)
    assert usual - evidence.usual == pytest.approx(5.0 * slowly)


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (0.3, 0.2, 1.0), (-0.4, 0.1, -2.5)])
def test_the_model_scan_shows_the_walls(pose):
    slam, lidar = default(), laser(721)
    slam.update(scan_at((0.0, 0.0, 0.0), lidar, np.array(box(-3.0, -2.0, 2.5, 2.2))))
    for turn in np.linspace(0.5, 6.0, 12):  # all walls are in the map
        slam.insert_at(
            scan_at((0.0, 0.0, turn), lidar, np.array(box(-3.0, -2.0, 2.5, 2.2))),
            Pose2(0.0, 0.0, turn),
        )
    model = slam._registration.cast(Pose2(*pose))
    x, y, nx, ny, r = model.points[model.points[:, 4] > 0.0].T
    assert len(r) > 0.97 * len(model.points)
    off = np.abs([x + 3.0, x - 2.5, y + 2.0, y - 2.2])
    assert off.min(axis=0).max() < 5e-3
    normals = np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])[off.argmin(axis=0)]
    cosines = nx * normals[:, 0] + ny * normals[:, 1]
    assert np.quantile(cosines, 0.1) > 0.99  # but for corners
    assert r == pytest.approx(np.hypot(x - pose[0], y - pose[1]))
    fan = model.fan
    angles = np.arctan2(y - pose[1], x - pose[0]) - pose[2] - fan.first
    rays = np.flatnonzero(model.points[:, 4] > 0.0)
    assert np.sin(angles - rays * fan.gap) == pytest.approx(np.zeros(len(r)), abs=1e-9)


def test_the_model_scan_shows_the_front_of_what_is_near():
    plate = np.array([*box(1.0, -0.3, 1.02, 0.3), *box(-3.0, -3.0, 3.0, 3.0)])
    slam = default()
    slam.update(scan_at((0.0, 0.0, 0.0), laser(721), plate))
    slam.insert_at(scan_at((2.2, 0.0, np.pi), laser(721), plate), Pose2(2.2, 0.0, np.pi))
    for base, sees in ((Pose2(0.0, 0.0, 0.0), 1.0), (Pose2(2.2, 0.0, np.pi), 1.02)):
        model = slam._registration.cast(base)
        ahead = np.abs(model.fan.first + np.arange(model.fan.rays) * model.fan.gap) < 0.15
        assert model.points[ahead, 0] == pytest.approx(np.full(ahead.sum(), sees), abs=2e-3)


def icp_by_hand(model, elements, pose, gate, rule):
    """Pairs and normal equations of point to line, the plain way."""
    H, b, pairs = np.zeros((3, 3)), np.zeros(3), 0
    hit = model.points[:, 4] > 0.0
    for x, y, nx, ny, information, _ in elements:
        p = Pose2(*pose).transform(np.array([[x, y]]))[0]
        n = Pose2(0.0, 0.0, pose[2]).transform(np.array([[nx, ny]]))[0]
        d = np.hypot(*(model.points[:, :2] - p).T)
        d[~hit | (model.points[:, 2:4] @ n <= 0.7)] = np.inf
        m = int(d.argmin())
        if not np.isfinite(d[m]):
            continue
        n, d = model.points[m, 2:4], p - model.points[m, :2]
        off, r = d @ n, model.points[m, 4]
        front = abs(n @ (p - (model.x, model.y))) + 0.1 * r
        if (
            abs(off) >= gate
            or abs(n[0] * d[1] - n[1] * d[0]) >= gate + model.fan.gap * r * r / front
        ):
            continue
        lever = p - pose[:2]
        J = np.array([n[0], n[1], n[1] * lever[0] - n[0] * lever[1]])
        w = (1.0 - (off / gate) ** 2) ** 2 / (1.0 / information + rule.map_noise**2)
        H, b, pairs = H + w * np.outer(J, J), b - w * J * off, pairs + 1
    return pairs, H, b


def test_icp_sums_the_nearest_pairs_point_to_line():
    slam, elements = scanned()
    pose = np.array(slam._track.pose) + np.array([0.02, -0.01, 0.01])
    model = slam._registration.cast(Pose2(*pose))
    rule = IcpRule(1, 1e-4, 1e-5, 0.1, 0.05, model.fan.rays, 0.01)
    room = np.zeros((4, 3))
    pairs, _ = sum_pairs(model, elements, len(elements), pose, rule, 0.1, room)
    count, H, b = icp_by_hand(model, elements, pose, 0.1, rule)
    assert pairs == count > 0.8 * len(elements)
    assert room[:3] == pytest.approx(H) and room[3] == pytest.approx(b)


def test_pairs_are_found_across_the_seam_of_a_full_circle():
    slam, lidar = default(), laser(720, fov=2.0 * math.pi * 719 / 720)
    slam.update(scan_at((0.0, 0.0, 0.0), lidar, np.array(box(-3.0, -2.0, 2.5, 2.2))))
    model = slam._registration.cast(IDENTITY)
    assert model.fan.around == model.fan.rays == 180
    for y in (0.02, -0.02):  # astern, on either side of the seam
        found = find_pair(model, -3.0, y, 1.0, 0.0, 2)
        assert np.hypot(*(model.points[found, :2] - (-3.0, y))) < 0.06
    assert find_pair(model, -3.0, 0.0, -1.0, 0.0, 2) == -1  # the back of the wall


@pytest.mark.parametrize("label", ["tsd", "tsd@paper"])
def test_the_mechanism_poses_every_scan(label):
    log = drive(n=60, odometry=False, gyro=False)
    truth, slam = log.truth_at(log.t), create(label)
    for p, scan in zip(truth, log, strict=True):
        distance, turn = error(Pose2(*truth[0]).between(Pose2(*p)), slam.update(scan))
        assert distance < 0.012 and turn < 0.006
    report = slam.report()
    assert report["posed"] == report["kept"] == 59
    assert report["refined"] == (59 if label == "tsd" else 0)
    assert report["rejected"] == report["searched"] == 0


def test_icp_comes_back_from_farther_than_the_field_reaches():
    slam = default(refine=False)
    slam.update(scan_at((0.0, 0.0, 0.0)))
    slam._view.see(scan_at((0.0, 0.0, 0.0)), IDENTITY)
    slam._track.prior = lambda pose: np.zeros((3, 3))
    off = Pose2(0.3, -0.28, 0.1)  # the field reaches 0.15 m
    found = slam._registration.icp(off, off)
    assert error(IDENTITY, found.pose)[0] < 0.005 and error(IDENTITY, found.pose)[1] < 0.003
    narrow = default(refine=False, widest_gate=0.02)
    narrow.update(scan_at((0.0, 0.0, 0.0)))
    narrow._view.see(scan_at((0.0, 0.0, 0.0)), IDENTITY)
    narrow._track.prior = lambda pose: np.zeros((3, 3))
    astray = narrow._registration.icp(off, off)
    assert astray is None or error(IDENTITY, astray.pose)[0] > 0.05


def test_what_icp_finds_elsewhere_is_refined_and_both_compete():
    slam, _ = scanned()
    pose = slam._track.pose
    slam._posed, slam._refined = [], []
    refined, posed = slam._candidates(pose @ Pose2(0.05, 0.03, 0.02), pose)
    assert refined is slam._refined[0] and posed is slam._posed[0]
    assert slam._candidates(pose, pose) == slam._posed[1:]  # leads to what was refined already


def test_range_noise_is_measured():
    walls, rng = np.array(box(-3.0, -2.0, 2.5, 2.2)), np.random.default_rng(8)
    for sigma in (0.003, 0.05):
        slam = default()
        for i in range(30):
            slam.update(scan_at((0.0, 0.0, 0.0), laser(721), walls, sigma, rng, 0.1 * i))
        assert slam._view.noise == pytest.approx(max(sigma, 0.01), rel=0.15)


def test_a_noisy_laser_is_followed_without_searching():
    log = drive(n=60, lidar=laser(721), noise=0.05, odometry=False, gyro=False)
    truth, slam = log.truth_at(log.t), default()
    for p, scan in zip(truth, log, strict=True):
        assert error(Pose2(*truth[0]).between(Pose2(*p)), slam.update(scan))[0] < 0.06
    report = slam.report()
    assert report["searched"] + report["rejected"] + report["lost"] == 0


def test_a_fruitless_search_rests_longer_each_time_and_success_ends_that():
    slam, _ = scanned()
    search, evidence = slam._search, slam._evidence
    poor = Match(IDENTITY, 0.1, 0.05, 0.0, 0.1, np.zeros((3, 3)))
    fine = Match(IDENTITY, 1.0, 1.0, 1.0, 0.01, np.zeros((3, 3)))
    assert evidence.as_usual(fine) and not evidence.as_usual(poor)
    tried = []
    for i in range(200):
        search.begin(0.025)
        wanted = search.wanted(poor, 1.0)
        search.end(poor, wanted, better=False)
        tried += [i] if wanted else []
    assert np.diff(tried).tolist() == sorted(np.diff(tried)) and 5 <= len(tried) <= 9
    search.end(fine, searched=True, better=True)
    search.begin(0.025)
    assert search.wanted(poor, 1.0) and search.wanted(poor, 2.0)
    assert not search.wanted(fine, 2.0)


def test_a_hit_alone_between_far_beams_has_no_normal():
    for n_beams, alone in ((41, True), (1081, False)):
        lidar = laser(n_beams)
        ranges = np.full(n_beams, np.inf, np.float32)
        ranges[n_beams // 2] = 6.0
        beams, hits, count = hits_of(ranges, lidar)
        runs, sums, out = np.zeros((count, 2)), np.zeros((count + 1, 5)), np.zeros((count, 6))
        rule = RULE._replace(widest=0.5)
        find_runs(hits, count, beams, rule, runs)
        sum_moments(hits, count, sums)
        assert fit_surfaces(hits, count, runs, sums, beams, rule, 0.05, out) == (not alone)
        assert fit_surfaces(hits, count, runs, sums, beams, rule, 0.0, out) == 1
        assert np.hypot(*out[0, 2:4]) == pytest.approx(0.0 if alone else 1.0)
        line = out.copy()
        lines = np.zeros((1, 7))
        place_lines(line, 1, runs, beams, np.zeros(3), lines)
        field, rows = TileField(0.05, 0.15, 100.0).kernel, np.zeros((999, 4))
        rule = PushRule(0.15, 100.0, lidar.angle_increment)
        assert not alone or list_rows(field, lines, 1, rule, rows) == 0


def test_a_frozen_map_stays_and_an_inserted_scan_enters_it():
    slam, room = default(), np.array(box(-3.0, -2.0, 2.5, 2.2))
    slam.insert_at(scan_at((1.0, 0.5, 0.3), segments=room), Pose2(1.0, 0.5, 0.3))
    assert slam.report()["pushed"] == 1 and slam._track.pose == Pose2(1.0, 0.5, 0.3)
    assert occupied(slam, 2.5, 0.5)
    slam.frozen = True
    before = slam.map().p.copy()
    for i in range(4):
        at = (1.0 + 0.1 * i, 0.5, 0.3)
        found = slam.update(scan_at(at, segments=room, t=0.5 * i))
    assert found == pytest.approx(at, abs=0.02)
    assert np.array_equal(slam.map().p, before, equal_nan=True)


def test_scans_that_were_lost_on_the_way_change_nothing():
    log = drive(n=120, odometry=False, gyro=False)
    truth, slam = log.truth_at(log.t), default()
    kept = [i for i in range(120) if i < 30 or i % 4 == 0]
    for i, scan in ((i, scan) for i, scan in enumerate(log) if i in kept):
        found = slam.update(scan)
        step = Pose2(*truth[0]).between(Pose2(*truth[i]))
        assert error(step, found)[0] < 0.01, i
    assert slam.report()["searched"] == slam.report()["rejected"] == 0


def test_a_slow_sweep_is_seen_again_with_the_velocity_that_was_found():
    lidar = laser(361, time_increment=0.19 / 361)
    log = drive(n=60, rate=5.0, lidar=lidar, odometry=False, gyro=False)
    truth, errors = log.truth_at(log.t), []
    steps = [Pose2(*a).between(Pose2(*b)) for a, b in pairwise(truth)]
    for again in (True, False):
        slam = default()
        if not again:
            slam._looks_again = lambda scan, pose: False
        found = [Pose2(*p) for p in replay(slam, log).poses]
        errors.append(
            np.mean(
                [
                    error(a.between(b), s)[0]
                    for (a, b), s in zip(pairwise(found), steps, strict=True)
                ]
            )
        )
    assert errors[0] < 0.8 * errors[1]


def test_beam_score_equals_the_naive_twin():
    lidar = laser(181)
    ranges = cast(np.array(box(-2.0, -2.0, 2.5, 2.0)), (0, 0, 0), lidar)
    model = ranges[:, None] * lidar.directions
    closest, mask = np.zeros((181, 2)), np.arange(181) % 7 != 3
    closest_beams(model, mask, lidar.angle_increment, closest)
    angles = np.array([lidar.angle_min, lidar.angle_increment])
    beam_model = BeamModel(0.2, 0.2, 0.2, 0.05, 0.1, 0.08, 30.0, 0.0262, 0.6, 0.15)
    control = np.column_stack([model[::9], np.zeros(21)])
    for motion in ((0.0, 0.0, 0.0), (0.05, -0.03, 0.02), (0.8, 0.5, 0.3)):
        score = score_beams(closest, angles, control, 21, np.array(motion), beam_model, 0.0)
        twin = naive_tsd.beam_score(closest, angles, control[:, :2], motion, beam_model)
        assert score == pytest.approx(twin, rel=1e-9)


@pytest.mark.parametrize("layer", range(4))
def test_a_surface_is_one_cell_wide_where_it_crosses(layer):
    x = (np.arange(12) + 0.5) * 0.05
    tsd = np.tile((x - 0.31) * (1 if layer < 2 else -1), (9, 1)).astype(np.float32)
    image = tsd if layer % 2 == 0 else np.ascontiguousarray(tsd.T)
    cells = surface_cells(image, layer, 0.05)
    cells = cells if layer % 2 == 0 else cells.T
    assert (cells.sum(axis=1) == 1).all() and cells[:, 6].all()
    assert not surface_cells(-image, layer, 0.05).any()  # faces the other way
    assert not surface_cells(3.0 * image, layer, 0.05).any()  # two surfaces, none between
    assert not surface_cells(0.5 * image, layer, 0.05).any()  # shows in the other axis' layer


def test_walls_of_the_map_are_thin_and_nothing_else_is_occupied():
    slam, room = default(), np.array(box(-3.0, -2.0, 2.5, 2.2))
    for scan in drive(n=40, segments=room):
        slam.update(scan)
    grid = slam.map()
    iy, ix = np.nonzero(grid.p > 0.5)
    first = Pose2(*drive(n=1).truth_at(np.zeros(1))[0])
    points = first.transform(np.stack([ix, iy], axis=1) * 0.05 + 0.025 + np.array(grid.origin))
    off = np.min(np.abs(points[:, [0, 0, 1, 1]] - [-3.0, 2.5, -2.0, 2.2]), axis=1)
    assert off.max() < 0.05
    assert np.nanmin(grid.p) < 0.05
    seen = next(iter(drive(n=1, noise=0.0, segments=room)))
    ends = seen.ranges[:, None] * seen.laser.directions
    covered = np.mean([occupied(slam, x, y) for x, y in ends])
    assert covered > 0.98
    assert len(ix) < 400  # the outline is 19.4 m, 388 cells, and not all of it is seen


def test_pictures_show_both_sides_of_the_field():
    slam = default()
    slam.update(scan_at((0.0, 0.0, 0.0)))
    image = slam.pictures()["map_tsd.png"]
    assert image.dtype == np.uint8 and image.ndim == 3
    tsd = np.array([[np.nan, 0.1, -0.1], [0.0, 0.05, np.nan]], np.float32)
    shown = colored(tsd, 0.1)
    assert shown[1, 0].tolist() == [205, 205, 205]  # north is up
    assert shown[1, 1].tolist() == [255, 255, 255] and shown[0, 0].tolist() == [0, 0, 255]
    assert shown[0, 1].tolist() == [255, 127, 127]
    assert colored(np.full((2, 2), np.nan, np.float32), 0.1).shape == (1, 1, 3)


def test_rays_jump_over_free_space_without_missing_anything():
    slam = Original(OriginalParams(registration="icp", map_size=6))
    slam.update(scan_at((0.0, 0.0, 0.0)))
    slam.update(scan_at((0.3, 0.1, 0.2), t=0.1))
    kernel, sensor = slam._grid.kernel, slam._view.sensor
    assert 0.01 < kernel.near.mean() < 0.5
    for pose in ((0.3, 0.1, 0.2), (-1.0, 0.5, 2.0), (4.6, 1.1, 1.0), (5.2, 0.0, 0.3)):
        found = []
        for near in (kernel.near, np.ones_like(kernel.near)):
            points, mask = np.zeros((361, 2)), np.zeros(361, np.bool_)
            cast_rays(kernel._replace(near=near), np.array(pose), sensor, points, mask)
            found.append((points, mask))
        assert np.array_equal(found[0][1], found[1][1])
        assert found[0][0] == pytest.approx(found[1][0], abs=1e-9)


def near_by_hand(tsd):
    n = len(tsd)
    padded = np.pad(tsd, ((0, 1), (0, 1)), constant_values=np.nan)
    below = [padded[j : j + n, i : i + n] <= 0.0 for j in (0, 1) for i in (0, 1)]
    return np.any(below, axis=0).reshape(n // 8, 8, n // 8, 8).any(axis=(1, 3))


def test_cells_below_zero_are_near_for_every_interpolation_that_reads_them(pushed):
    kernel, sensor, pose, ranges, _ = pushed
    assert np.array_equal(kernel.near, near_by_hand(kernel.tsd))
    grid, mask = TsdGrid(0.05, 0.15, 256, True), np.ones(541, np.bool_)
    grid.push(np.array(pose), ranges, mask, sensor)
    side = len(grid.kernel.tsd)
    far = np.array([6.0, 6.0, 0.0])
    grid.push(far, np.full(541, np.inf), np.zeros(541, np.bool_), sensor)
    grid.push(far, np.full(541, 3.0), mask, sensor)
    assert len(grid.kernel.tsd) > side
    below = near_by_hand(grid.kernel.tsd)
    assert (grid.kernel.near | ~below).all()


def test_the_pool_of_tiles_grows(monkeypatch):
    monkeypatch.setattr("tsd.map.POOL", 64)
    slam = default()
    for scan in drive(n=40, gyro=False):
        slam.update(scan)
    kernel = slam._field.kernel
    assert 64 < kernel.used[0] < len(kernel.tsd)


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
    assert slam.report()["rejected"] == 0


def test_the_picture_is_drawn(tmp_path):
    draw(tmp_path / "idea.png")
    assert 10_000 < (tmp_path / "idea.png").stat().st_size < 150_000
