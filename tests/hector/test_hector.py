import dataclasses
import math

import numpy as np
import pytest

from hector import (
    Hector,
    HectorParams,
    map_kernels,
    match_kernels,
)
from hector.map import LogOddsPyramid
from hector.map_kernels import Level, Update
from hector.original import Original, OriginalParams
from hector.original import map_kernels as original_map
from hector.original import match_kernels as original_match
from hector.original import scan_kernels as original_scan
from hector.original.map import Pyramid
from slams import metrics
from slams.geometry import Prior
from slams.player import replay
from slams.refine import line_kernels, surface_kernels
from slams.refine.line_kernels import Fit, View
from slams.refine.lines import ONCE
from slams.refine.surface_kernels import Splat, Surface
from slams.scan import scan_kernels
from slams.scan.end_points import EndPoints
from slams.scan.scan_kernels import Grain, Limits, Twist
from slams.types import IDENTITY, Pose2, Scan
from tests.hector import naive
from tests.rooms import CORRIDOR, ROOM, cast, drive, laser, mirrored, scan_at

FREE, OCCUPIED = math.log(0.4 / 0.6), math.log(0.9 / 0.1)
UPDATE = Update(FREE, OCCUPIED, 50.0, math.exp(FREE))
NOTHING = Prior(IDENTITY, np.zeros((3, 3)))  # is known before the scan
GRAIN = Grain(0.0, 0.05, 0.1)
FIT = Fit(20, 1e-6, 0.01, 1, 0.05, 1e-4)
both_maps = pytest.mark.parametrize("kernels", [map_kernels, original_map])


def level(height, width, resolution=0.1, x0=0.0, y0=0.0, unknown=0.0):
    shape = (height, width)
    p = np.full(shape, unknown, np.float32)
    return Level(np.zeros(shape, np.float32), p, np.zeros(shape, np.int32), x0, y0, resolution)


def smooth_level(seed=0, size=40, resolution=0.1):
    rng = np.random.default_rng(seed)
    grid = level(size, size, resolution, -0.5 * size * resolution, -0.5 * size * resolution)
    grid.p[:] = rng.random((size, size))
    return grid


def column(x, y):
    return np.array([[x], [y]], np.float64)


def view(ends):
    """End points (3, n) whose normals are not known, seen from the origin."""
    return View(ends, np.zeros_like(ends), ends.shape[1], IDENTITY)


def seen(points):
    return View(points.points, points.normals, points.n, points.mount)


def fitted(pyramid, points, start, H, how=FIT):
    known = tuple(NOTHING.pose), NOTHING.information
    surface = pyramid.lines.surface
    return line_kernels.fit(surface, seen(points), tuple(start), known, tuple(how), H)


# scan preparation


def test_end_points_filters_mounts_and_measures():
    lidar = laser(5, fov=math.pi, mount=Pose2(0.2, 0.1, math.pi / 2))
    ranges = np.array([1.0, np.nan, np.inf, 0.3, 2.0], np.float32)
    ranges.flags.writeable = False
    out = np.zeros((3, 5))
    n, far = scan_kernels.end_points(ranges, lidar.directions, lidar.mount, Limits(0.4, 30.0), out)
    assert n == 2
    assert out[:, 0] == pytest.approx([1.2, 0.1, 0.0])  # beam at -90 deg, turned by the mount
    assert out[:, 1] == pytest.approx([-1.8, 0.1, 4.0])
    assert far == pytest.approx(math.hypot(1.8, 0.1))
    theirs = np.zeros((3, 5))
    limits = original_scan.Limits(0.4, 30.0, 0.0)
    n = original_scan.end_points(ranges, lidar.directions, lidar.mount, limits, theirs)
    assert (n, theirs.tolist()) == (2, out.tolist())


def test_the_body_filter_hides_near_ends_behind():
    lidar = laser(3, fov=2.0 * math.pi * 2 / 3)
    ranges = np.array([0.6, 0.6, 0.8], np.float32)
    ranges.flags.writeable = False
    out = np.zeros((3, 3))
    limits = original_scan.Limits(0.1, 30.0, 0.7071)
    assert original_scan.end_points(ranges, lidar.directions, lidar.mount, limits, out) == 2


@pytest.mark.parametrize("still", [0.0, 270.0])
def test_a_moving_sweep_is_brought_to_the_time_of_one_beam(still):
    velocity, lidar = Pose2(0.8, 0.1, 1.2), laser(541, mount=Pose2(0.1, 0.0, 0.2))
    delay = 0.1 / 541
    ranges = np.empty(541, np.float32)
    for i in range(541):
        pose = exponential(velocity, i * delay)
        one = dataclasses.replace(lidar, angle_min=lidar.angles[i], n_beams=1)
        ranges[i] = cast(ROOM, pose, one)[0]
    ranges.flags.writeable = False
    out = np.zeros((3, 541))
    limits = Limits(0.1, 30.0)
    n, _ = scan_kernels.end_points(ranges, lidar.directions, lidar.mount, limits, out)
    assert n == 541
    assert distance_to_walls(out[:2]).max() > 0.1
    theirs = out.copy()
    scan_kernels.deskew(out, n, Twist(*velocity, delay, still))
    original_scan.deskew(theirs, n, original_scan.Twist(*velocity, delay))
    assert (theirs == out).all() == (still == 0.0)
    there = exponential(velocity, still * delay).transform(out[:2].T).T
    assert distance_to_walls(there).max() < 2e-3


def exponential(velocity, t):
    n = 1000
    pose = IDENTITY
    for _ in range(n):
        pose = pose @ Pose2(velocity.x * t / n, velocity.y * t / n, velocity.theta * t / n)
    return pose


def distance_to_walls(points):
    a, b = ROOM[:, :2], ROOM[:, 2:]
    along = b - a
    p = points.T[:, None, :] - a
    u = np.clip((p * along).sum(-1) / (along**2).sum(-1), 0.0, 1.0)
    return np.linalg.norm(p - u[..., None] * along, axis=-1).min(axis=1)


# interpolation and Gauss-Newton on occupancy


def test_interpolation_at_a_cell_is_the_cell_and_between_is_bilinear():
    p = smooth_level().p
    for x, y in ((3.0, 5.0), (3.25, 5.5), (10.9, 0.1)):
        for kernels in (match_kernels, original_match):
            assert kernels.interpolate(p, x, y)[0] == pytest.approx(naive.map_value(p, x, y))
    for outside in ((-0.1, 3.0), (3.0, -0.1), (38.1, 3.0), (3.0, 38.1), (math.nan, 3.0)):
        for kernels in (match_kernels, original_match):
            assert kernels.interpolate(p, *outside) == (0.0, 0.0, 0.0)


def test_the_exact_gradient_is_the_derivative_and_the_originals_is_not():
    p, h = smooth_level().p, 1e-4
    for x, y in ((3.2, 5.7), (10.9, 0.1), (20.3, 30.8)):
        slope_x = (naive.map_value(p, x + h, y) - naive.map_value(p, x - h, y)) / (2 * h)
        slope_y = (naive.map_value(p, x, y + h) - naive.map_value(p, x, y - h)) / (2 * h)
        slope = (slope_x, slope_y)
        assert match_kernels.interpolate(p, x, y)[1:] == pytest.approx(slope, abs=1e-3)
        assert original_match.interpolate(p, x, y)[1:] != pytest.approx(slope, abs=1e-2)
        ix, iy, fx, fy = int(x), int(y), x % 1.0, y % 1.0
        (p00, p10), (p01, p11) = p[iy : iy + 2, ix : ix + 2].astype(float)
        swapped = (
            (1.0 - fx) * (p10 - p00) + fx * (p11 - p01),
            (1.0 - fy) * (p01 - p00) + fy * (p11 - p10),
        )
        assert original_match.interpolate(p, x, y)[1:] == pytest.approx(swapped, abs=1e-5)


def test_normal_equations_are_the_gradient_of_the_cost():
    grid, rng = smooth_level(), np.random.default_rng(1)
    points = rng.uniform(-1.0, 1.0, (2, 50))
    H, b = np.zeros((3, 3)), np.zeros(3)

    def residuals(pose):
        moved = pose.transform(points.T)
        return np.array(
            [
                1.0 - naive.map_value(grid.p, (x - grid.x0) / 0.1, (y - grid.y0) / 0.1)
                for x, y in moved
            ]
        )

    pose, h = np.array([0.03, -0.02, 0.1]), 1e-6
    score, square = match_kernels.normal_equations(grid, points, 50, 1, Pose2(*pose), H, b)
    J = np.stack(
        [
            (residuals(Pose2(*(pose + h * e))) - residuals(Pose2(*(pose - h * e)))) / (2 * h)
            for e in np.eye(3)
        ],
        axis=1,
    )
    r = residuals(Pose2(*pose))
    assert pytest.approx(H, rel=1e-4) == J.T @ J
    assert -J.T @ r == pytest.approx(b, rel=1e-4, abs=1e-4)
    assert score == pytest.approx(1.0 - r.mean())
    assert square == pytest.approx(np.mean(r * r))


def test_a_step_of_the_original_is_limited_in_angle_only():
    grid = smooth_level()
    points = np.array([[1.0, 1.01, -1.0], [0.0, 0.02, 0.03]])
    free, turned = (
        original_match.gauss_newton(grid, points, 3, IDENTITY, 1, limit) for limit in (0.2, 0.02)
    )
    assert abs(free.theta) > 0.03
    assert turned == (free.x, free.y, math.copysign(0.02, free.theta))
    assert math.hypot(free.x, free.y) > 0.01


# map update


@both_maps
@pytest.mark.parametrize("turn", np.linspace(-math.pi, math.pi, 17))
def test_insertion_equals_its_twin_in_every_octant(turn, kernels):
    grid, rng = level(60, 70, 0.1, -3.5, -3.0), np.random.default_rng(3)
    points = rng.uniform(-2.5, 2.5, (2, 30))
    pose, mount = Pose2(0.13, -0.21, turn), Pose2(0.3, 0.2, 0.0)
    kernels.insert(grid, points, 30, pose, mount, 1, UPDATE)
    expected = naive.inserted((60, 70), -3.5, -3.0, 0.1, points, pose, (0.3, 0.2), FREE, OCCUPIED)
    assert grid.log_odds == pytest.approx(expected, abs=1e-6)
    seen = expected != 0.0
    assert grid.p[seen] == pytest.approx(1.0 / (1.0 + np.exp(-expected[seen])), abs=1e-6)
    assert (grid.p[~seen] == 0.0).all()


@both_maps
def test_insertion_on_a_hand_made_grid(kernels):
    grid = level(5, 5, 1.0)
    kernels.insert(grid, column(4.0, 2.0), 1, IDENTITY, IDENTITY, 1, UPDATE)
    expected = np.zeros((5, 5))
    expected[0, 0] = expected[1, 1] = expected[1, 2] = expected[2, 3] = FREE
    expected[2, 4] = OCCUPIED
    assert grid.log_odds == pytest.approx(expected)


@both_maps
def test_a_cell_crossed_and_hit_in_one_scan_is_exactly_occupied(kernels):
    for points in ([[2.0, 4.0], [0.0, 0.0]], [[4.0, 2.0], [0.0, 0.0]]):
        grid = level(5, 6, 1.0)
        kernels.insert(grid, np.array(points), 2, IDENTITY, IDENTITY, 1, UPDATE)
        assert grid.log_odds[0, 2] == pytest.approx(OCCUPIED)
        assert grid.log_odds[0, 1] == pytest.approx(FREE)


@both_maps
def test_log_odds_stop_at_the_ceiling_and_scans_add_up(kernels):
    grid = level(5, 6, 1.0)
    for number in range(1, 40):
        kernels.insert(grid, column(4.0, 0.0), 1, IDENTITY, IDENTITY, number, UPDATE)
    assert 50.0 <= grid.log_odds[0, 4] < 50.0 + OCCUPIED
    assert grid.log_odds[0, 1] == pytest.approx(39 * FREE, rel=1e-5)


@both_maps
def test_beams_that_leave_the_grid_are_skipped_whole(kernels):
    grid = level(5, 5, 1.0)
    kernels.insert(grid, column(9.0, 0.0), 1, IDENTITY, IDENTITY, 1, UPDATE)
    kernels.insert(grid, column(1.0, 0.0), 1, Pose2(-9.0, 0.0, 0.0), IDENTITY, 2, UPDATE)
    kernels.insert(grid, column(0.2, 0.0), 1, IDENTITY, IDENTITY, 3, UPDATE)
    assert not grid.log_odds.any()


# the lines inside the cells


def empty_surface(size=200, resolution=0.05, rows=4096):
    half = -0.5 * size * resolution
    return Surface(
        np.zeros((size, size), np.int32),
        np.zeros((rows, 14), np.float32),
        np.zeros((rows, 8), np.float32),
        np.zeros(1, np.int64),
        np.zeros((size, size), np.float32),
        half,
        half,
        resolution,
    )


def normals_of(scan):
    points = EndPoints(HectorParams()).take(scan, IDENTITY)
    scan_kernels.scan_normals(
        points.points, points.n, points.mount, points.step, GRAIN, points.moments, points.normals
    )
    return points.points[:2, : points.n], points.normals[:, : points.n]


def test_scan_normals_stand_on_the_walls_and_face_the_sensor():
    points, normals = normals_of(scan_at((0.5, 0.3, 0.4), laser(1081)))
    found = normals[0] ** 2 + normals[1] ** 2 > 0.0
    assert found.mean() > 0.85
    assert (normals[0] * points[0] + normals[1] * points[1])[found].max() < 0.0
    world = np.abs(Pose2(0.0, 0.0, 0.4).transform(normals[:2, found].T))
    assert (np.minimum(world[:, 0], world[:, 1]) < 0.02).mean() > 0.9  # walls are axis-parallel


def test_scan_normals_equal_a_total_least_squares_fit():
    rng = np.random.default_rng(0)
    x = np.linspace(-0.06, 0.06, 13)
    points = np.stack([x, 2.0 + 0.3 * x + rng.normal(0.0, 0.001, 13)])
    out, moments = np.zeros((3, 13)), np.zeros((6, 14))
    scan_kernels.scan_normals(points, 13, IDENTITY, 0.005, GRAIN, moments, out)
    half = 2 + int(0.05 / (0.005 * math.hypot(*points[:, 6]) + 1e-6))
    window = points[:, 6 - half : 7 + half]
    _, vectors = np.linalg.eigh(np.cov(window))
    normal = vectors[:, 0] * -np.sign(vectors[:, 0] @ points[:, 6])
    assert out[:2, 6] == pytest.approx(normal, abs=1e-6)


def test_a_lone_beam_has_no_normal():
    points = np.array([[1.0, 5.0, 1.0], [0.0, 0.5, 1.0]])
    out, moments = np.zeros((3, 3)), np.zeros((6, 4))
    scan_kernels.scan_normals(points, 3, IDENTITY, 0.01, GRAIN, moments, out)
    assert not out[:2].any()


def test_a_corner_has_no_normal():
    along = np.linspace(0.3, 0.0, 31)
    points = np.stack(
        [np.r_[along, np.zeros(30)] + 1.0, np.r_[np.zeros(31), -along[::-1][1:]] + 2.0]
    )
    out, moments = np.zeros((3, 61)), np.zeros((6, 62))
    scan_kernels.scan_normals(points, 61, IDENTITY, 0.004, GRAIN, moments, out)
    found = np.hypot(out[0], out[1]) > 0.0
    assert not found[29:32].any()
    assert found[:20].all()
    assert found[-20:].all()


def test_a_wall_is_not_met_from_behind():
    surface = empty_surface()
    points = np.stack([np.full(20, 1.0), np.linspace(-0.3, 0.3, 20)])
    normals = np.stack([np.full(20, -1.0), np.zeros(20), np.zeros(20)])
    surface_kernels.add_scan(surface, points, normals, 20, IDENTITY, Splat(1, 0, 1e6, 1, ONCE))
    H, b = np.zeros((3, 3)), np.zeros(3)
    for sensor, met in ((0.0, True), (2.0, False)):
        ends = points - np.array([[sensor], [0.0]])
        pose = Pose2(sensor, 0.0, 0.0)
        total, _, near = line_kernels.line_equations(surface, view(ends), 1, pose, 400.0, H, b)
        assert (total > 0.0) == met
        assert (near > 0.0) == met


def test_a_line_is_the_mean_of_its_hits():
    surface = empty_surface()
    points = np.array([[0.50, 0.51, 0.52], [1.20, 1.22, 1.21]])
    normals = np.array([[0.0, 0.0, 0.0], [-1.0, -1.0, -1.0], [0.0, 0.0, 0.0]])
    surface_kernels.add_scan(surface, points, normals, 3, IDENTITY, Splat(1, 0, 1e6, 1, ONCE))
    slot = surface.slot[round((1.2 + 5.0) / 0.05), round((0.5 + 5.0) / 0.05)]
    assert surface.lines[slot, :4] == pytest.approx([0.0, -1.0, -1.21, 0.1 * 3.0 / 5.0], abs=1e-6)
    assert (surface.slot > 0).sum() == 3 == surface.used[0]  # one cell to each side of the wall


def test_the_two_faces_of_a_thin_wall_stay_apart():
    surface, splat = empty_surface(), Splat(1, 0, 1e6, 1, ONCE)
    for offset, toward in ((0.0, -1.0), (0.03, 1.0)):
        points = np.stack([np.full(20, 1.0 + offset), np.linspace(-0.3, 0.3, 20)])
        normals = np.stack([np.full(20, toward), np.zeros(20), np.zeros(20)])
        surface_kernels.add_scan(surface, points, normals, 20, IDENTITY, splat)
    slot = surface.slot[100, 120]
    assert surface.lines[slot, [0, 2]] == pytest.approx([-1.0, -1.0], abs=1e-6)
    assert surface.lines[slot, [4, 6]] == pytest.approx([1.0, 1.03], abs=1e-6)


def test_a_capped_line_follows_a_moved_wall_and_an_uncapped_hardly():
    def distance(cap):
        surface = empty_surface()
        for offset, times in ((0.0, 60), (0.02, 30)):
            for _ in range(times):
                surface_kernels.add_scan(
                    surface,
                    column(1.0 + offset, 0.0),
                    np.array([[-1.0], [0.0], [0.0]]),
                    1,
                    IDENTITY,
                    Splat(0, 0, cap, 1, ONCE),
                )
        return -surface.lines[1, 2]

    assert distance(10.0) == pytest.approx(1.02, abs=0.001)
    assert distance(1e6) == pytest.approx(1.02 - 0.02 * 2 / 3, abs=0.001)


def test_a_full_pool_refuses_more_cells_without_harm():
    surface = empty_surface(rows=2)
    points = np.array([[0.0, 1.0], [1.0, 0.0]])
    normals = np.array([[0.0, -1.0], [-1.0, 0.0], [0.0, 0.0]])
    surface_kernels.add_scan(surface, points, normals, 2, IDENTITY, Splat(1, 0, 1e6, 1, ONCE))
    assert surface.used[0] == 1


def mapped_room(pose=IDENTITY, n_beams=1081, times=3):
    params = HectorParams()
    pyramid, points = LogOddsPyramid(params), EndPoints(params)
    points.take(scan_at(pose, laser(n_beams)), IDENTITY)
    for _ in range(times):
        pyramid.insert(points, pose)
    return pyramid, points


def test_line_equations_equal_their_twin():
    pyramid, _ = mapped_room()
    surface = pyramid.lines.surface
    pose = Pose2(0.03, -0.02, 0.01)
    points = EndPoints(HectorParams()).take(scan_at((0.0, 0.0, 0.0), laser(181)), IDENTITY)

    def lines_at(x, y):
        ix = math.floor((x - surface.x0) / 0.05 + 0.5)
        iy = math.floor((y - surface.y0) / 0.05 + 0.5)
        rows = surface.lines[surface.slot[iy, ix]].astype(np.float64).reshape(2, 4)
        return [row for row in rows if row[3] > 0.0]

    H, b = np.zeros((3, 3)), np.zeros(3)
    line_kernels.line_equations(surface, seen(points), 1, pose, 400.0, H, b)
    used = points.points[:2, : points.n]
    expected_H, expected_b = naive.line_sums(lines_at, used, IDENTITY, np.array(pose), 400.0)
    assert pytest.approx(expected_H, rel=1e-4, abs=1e-6) == H
    assert b == pytest.approx(expected_b, rel=1e-4, abs=1e-4)


MOTIONS = [
    Pose2(0.03, 0.0, 0.0),
    Pose2(0.0, -0.03, 0.0),
    Pose2(0.0, 0.0, 0.012),
    Pose2(-0.02, 0.015, -0.01),
]


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("way", ["forward", "inverse", "shifted"])
def test_fit_recovers_a_known_motion(motion, way):
    base = Pose2(0.4, -0.3, 0.8) if way == "shifted" else IDENTITY
    target = base @ (motion.inverse() if way == "inverse" else motion)
    pyramid, _ = mapped_room(base)
    points = EndPoints(HectorParams()).take(scan_at(target, laser(1081)), IDENTITY)
    H = np.zeros((3, 3))
    pose, share, square = fitted(pyramid, points, base, H)
    assert pose == pytest.approx(target, abs=1.5e-3)
    assert share > 0.85
    assert math.sqrt(square) < 3e-3


def test_a_mirrored_world_gives_the_mirrored_result():
    results = []
    for sign, segments in ((1.0, ROOM), (-1.0, mirrored(ROOM))):
        lidar = laser(1081)
        params = HectorParams()
        pyramid, points = LogOddsPyramid(params), EndPoints(params)
        pyramid.insert(points.take(scan_at((0, 0, 0), lidar, segments), IDENTITY), IDENTITY)
        points.take(scan_at((0.03, sign * 0.02, sign * 0.01), lidar, segments), IDENTITY)
        pose, _, _ = fitted(pyramid, points, IDENTITY, np.zeros((3, 3)))
        results.append(np.array(pose) * [1.0, sign, sign])
    assert results[0] == pytest.approx(results[1], abs=1e-3)


@pytest.mark.parametrize("motion", [Pose2(0.15, -0.1, 0.06), Pose2(-0.1, 0.12, -0.08)])
def test_coarse_to_fine_recovers_a_large_motion(motion):
    slam = Hector(HectorParams())
    for _ in range(3):
        slam.update(scan_at((0, 0, 0), laser(1081)))
    points = slam._scan.take(scan_at(motion, laser(1081)), IDENTITY)
    assert slam._map.climb(points, IDENTITY, NOTHING).pose == pytest.approx(motion, abs=0.03)


# the whole algorithm


def test_tracks_the_room_close_to_the_bound(room_log):
    run = replay(Hector(HectorParams()), room_log.select(odometry=False))
    truth = room_log.truth_at(run.t)
    translation, rotation = metrics.relative_errors(run.poses, truth, 1)
    assert translation.mean() < 2.0e-3
    assert rotation.mean() < 0.8e-3
    assert metrics.ate(run.poses, truth) < 3e-3


def test_the_original_is_coarser_but_tracks_too(room_log):
    truth = room_log.truth_at(room_log.t)
    run, ours = (
        replay(slam, room_log.select(odometry=False))
        for slam in (Original(OriginalParams()), Hector(HectorParams()))
    )
    assert metrics.ate(run.poses, truth) < 0.05
    assert metrics.ate(run.poses, truth) > 2.0 * metrics.ate(ours.poses, truth)


def test_five_scans_a_second_without_odometry():
    log = drive(n=100, rate=5.0, odometry=False, gyro=False)
    run = replay(Hector(HectorParams()), log)
    assert metrics.ate(run.poses, log.truth_at(run.t)) < 0.01
    assert run.report["searched"] == 0


def test_the_mount_is_respected():
    mount = Pose2(0.25, -0.1, 2.0)
    log = drive(n=80, lidar=laser(mount=mount), odometry=False)
    run = replay(Hector(HectorParams()), log)
    assert metrics.ate(run.poses, log.truth_at(run.t)) < 5e-3


def test_deskewing_pays_on_a_real_sweep():
    lidar = laser(181, time_increment=0.1 / 181)
    log = drive(n=40, rate=10.0, lidar=lidar, odometry=False, gyro=False, noise=0.003)
    errors = {}
    for deskew in (True, False):
        run = replay(Hector(HectorParams(deskew=deskew)), log)
        errors[deskew] = metrics.ate(run.poses, log.truth_at(run.t))
    assert errors[True] < 0.5 * errors[False]


def test_a_corridor_is_driven_by_odometry_where_no_wall_decides():
    lidar = laser(361, range_max=10.0)
    slam = Hector(HectorParams())
    for k in range(60):
        pose = Pose2(0.05 * k, 0.0, 0.0)
        pose_found = slam.update(scan_at(pose, lidar, CORRIDOR, t=0.05 * k, odometry=pose))
    assert pose_found == pytest.approx(pose, abs=0.1)
    variance = np.diag(slam.covariance)
    assert variance[0] > 100.0 * variance[1]


def test_recovers_from_a_jump_by_searching():
    slam = Hector(HectorParams())
    for k in range(12):
        slam.update(scan_at((0, 0, 0), laser(1081), t=0.025 * k))
    target = Pose2(0.5, -0.4, 0.5)
    for k in range(20):  # a place beyond the gate has to stand for 0.3 s
        pose = slam.update(scan_at(target, laser(1081), t=0.3 + 0.025 * k))
        if k < 3:  # no robot is there so soon
            assert pose == pytest.approx(IDENTITY, abs=0.02)
            assert slam.state == "predicted"
    assert slam.state == "matched"
    assert pose == pytest.approx(target, abs=0.02)
    assert slam.report()["searched"] >= 1


def test_a_scan_of_elsewhere_is_refused_and_leaves_the_map_alone():
    slam = Hector(HectorParams())
    for k in range(12):
        slam.update(scan_at((0, 0, 0), t=0.05 * k))
    before = slam.map().p.copy()
    rng = np.random.default_rng(0)
    ranges = rng.uniform(0.3, 2.0, 361).astype(np.float32)
    ranges.flags.writeable = False
    pose = slam.update(Scan(0.6, ranges, laser()))
    assert pose == pytest.approx(IDENTITY, abs=0.02)
    assert slam.report()["predicted"] == 1
    assert slam.state == "predicted"
    assert np.array_equal(slam.map().p, before, equal_nan=True)
    inserted = slam.report()["inserted"]
    for k in range(8):
        slam.update(scan_at((0.05 * k, 0.0, 0.0), t=0.65 + 0.05 * k))
    assert slam.report()["inserted"] > inserted
    assert slam.report()["predicted"] == 1
    assert slam.state == "matched"


def test_the_map_grows_and_keeps_what_it_has():
    params = HectorParams(levels=3, max_cells=1 << 20)
    pyramid, points = LogOddsPyramid(params), EndPoints(params)
    points.take(scan_at((0, 0, 0)), IDENTITY)
    pyramid.insert(points, IDENTITY)
    before = pyramid.grid()
    shapes = [level.p.shape for level in pyramid.levels]
    pyramid._cover(Pose2(0.0, -70.0, 0.0), 5.0)
    after = pyramid.grid()
    assert np.array_equal(before.p, after.p, equal_nan=True)
    assert before.origin == pytest.approx(after.origin)
    for k, (level, shape) in enumerate(zip(pyramid.levels, shapes, strict=True)):
        assert level.p.shape[0] > shape[0]
        assert level.p.shape == (
            pyramid.levels[0].p.shape[0] >> k,
            pyramid.levels[0].p.shape[1] >> k,
        )
        steps = (level.x0 - pyramid.levels[0].x0) / 0.05
        assert steps == pytest.approx(0.0, abs=1e-6)
    H = np.zeros((3, 3))
    pose, share, _ = fitted(pyramid, points, Pose2(0.02, 0.0, 0.0), H)
    assert pose == pytest.approx(IDENTITY, abs=1e-3)
    assert share > 0.8


def test_the_originals_map_does_not_grow_and_halves_from_level_to_level():
    params = OriginalParams(map_size=100, levels=3)
    slam = Original(params)
    slam.update(scan_at((0, 0, 0)))
    assert slam.map().p.shape <= (100, 100)
    assert [grid.p.shape[0] for grid in Pyramid(params).levels] == [100, 50, 25]
    assert [grid.resolution for grid in slam._map.levels] == [0.05, 0.1, 0.2]


def test_the_original_forgets_the_motion_of_a_sweep_unless_told():
    lidar = laser(361, time_increment=0.2 / 361)
    log = drive(n=40, rate=5.0, lidar=lidar, odometry=False, gyro=False, noise=0.003)
    errors = {}
    for deskew in (True, False):
        run = replay(Original(OriginalParams(deskew=deskew, start="velocity")), log)
        errors[deskew] = metrics.ate(run.poses, log.truth_at(run.t))
    assert errors[True] < 0.7 * errors[False], errors


# against the C++ program's own trajectory


def test_the_original_follows_the_program_it_is_modeled_on(shared_data):
    from slams import load
    from slams.formats.trajectory import read

    reference = shared_data("reference/robocup/hector.csv.gz")
    log = load(shared_data("data/robocup/robocup.npz")).select(100, odometry=False)
    run = replay(Original(OriginalParams()), log)
    _, poses = read(reference)
    assert np.hypot(*(run.poses - poses[:100])[:, :2].T).max() < 3e-3
