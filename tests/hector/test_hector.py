"""hector: kernels of the occupancy and of its matching against twins, ours and the original's."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hector import map_kernels, match_kernels
from hector.map_kernels import Level, Update
from hector.original import Original, OriginalParams
from hector.original import map_kernels as original_map
from hector.original import match_kernels as original_match
from hector.original.motion import Motion
from hector.original.scan import EndPoints
from slams.types import IDENTITY, Pose2, Scan
from tests.hector import naive
from tests.rooms import laser, scan_at
from tests.slams.frontend.test_filter import scan as stamped

FREE, OCCUPIED = math.log(0.4 / 0.6), math.log(0.9 / 0.1)
UPDATE = Update(FREE, OCCUPIED, 50.0)
both_maps = pytest.mark.parametrize("kernels", [map_kernels, original_map])


def level(height, width, resolution=0.1, x0=0.0, y0=0.0):
    log_odds, p = np.zeros((2, height, width), np.float32)
    return Level(log_odds, p, np.zeros((height, width), np.int32), x0, y0, resolution)


def smooth_level():
    grid = level(40, 40, 0.1, -2.0, -2.0)
    grid.p[:] = np.random.default_rng(0).random((40, 40))
    return grid


def column(x, y):
    return np.array([[x], [y]], np.float64)


def test_the_body_filter_hides_near_ends_behind():
    lidar = laser(3, fov=2.0 * math.pi * 2 / 3)
    ranges = np.array([0.6, 0.6, 0.8], np.float32)
    ranges.flags.writeable = False
    points = EndPoints(OriginalParams(), lidar)
    points.read(Scan(0.0, ranges, lidar), IDENTITY)
    assert points.points[2, : points.n].tolist() == [1, 2]
    params, sweeping = (
        OriginalParams(deskew=True, body_radius=0.0),
        replace(lidar, time_increment=0.1),
    )
    swept = EndPoints(params, sweeping)
    swept.read(Scan(0.0, ranges, sweeping), Pose2(0.8, 0.1, 1.2))  # to the time of the first beam
    assert swept.points[:2, 0] == pytest.approx(0.6 * lidar.directions[0])


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
        swapped_x = (1.0 - fx) * (p10 - p00) + fx * (p11 - p01)
        swapped = (swapped_x, (1.0 - fy) * (p01 - p00) + fy * (p11 - p10))
        assert original_match.interpolate(p, x, y)[1:] == pytest.approx(swapped, abs=1e-5)


def test_the_heading_of_the_original_is_wrapped_after_a_match():
    grid, points = smooth_level(), np.zeros((2, 0))
    found = original_match.gauss_newton(grid, points, 0, Pose2(0.0, 0.0, 3.5), 1, 0.2)
    assert found.theta == pytest.approx(3.5 - math.tau)


def test_normal_equations_are_the_gradient_of_the_cost():
    grid, rng = smooth_level(), np.random.default_rng(1)
    points = rng.uniform(-1.0, 1.0, (2, 50))
    H, b = np.zeros((3, 3)), np.zeros(3)

    def residuals(pose):
        cells = (Pose2(*pose).transform(points.T) - (grid.x0, grid.y0)) / 0.1
        return np.array([1.0 - naive.map_value(grid.p, x, y) for x, y in cells])

    pose, h = np.array([0.03, -0.02, 0.1]), 1e-6
    score, square = match_kernels.normal_equations(grid, points, 50, 1, Pose2(*pose), H, b)
    ways = h * np.eye(3)
    J = np.array([(residuals(pose + way) - residuals(pose - way)) / (2 * h) for way in ways]).T
    r = residuals(pose)
    assert pytest.approx(H, rel=1e-4) == J.T @ J
    assert -J.T @ r == pytest.approx(b, rel=1e-4, abs=1e-4)
    assert score == pytest.approx(1.0 - r.mean())
    assert square == pytest.approx(np.mean(r * r))


def test_a_step_of_the_original_is_limited_in_rotation_only():
    grid = smooth_level()
    points = np.array([[1.0, 1.01, -1.0], [0.0, 0.02, 0.03]])
    step = original_match.gauss_newton
    free, turned = (step(grid, points, 3, IDENTITY, 1, limit) for limit in (0.2, 0.02))
    assert abs(free.theta) > 0.03
    assert turned == (free.x, free.y, math.copysign(0.02, free.theta))
    assert math.hypot(free.x, free.y) > 0.01


@both_maps
@pytest.mark.parametrize("turn", np.linspace(-math.pi, math.pi, 17))
def test_insertion_equals_its_twin_in_every_octant(turn, kernels):
    grid, rng = level(60, 70, 0.1, -3.5, -3.0), np.random.default_rng(3)
    points = np.tile(rng.uniform(-2.5, 2.5, (2, 15)), 2)  # two ends in each cell, not in a row
    pose, mount = Pose2(0.13, -0.21, turn), Pose2(0.3, 0.2, 0.0)
    kernels.insert(grid, points, 30, pose, mount, 1, UPDATE)
    expected = naive.inserted((60, 70), -3.5, -3.0, 0.1, points, pose, (0.3, 0.2), FREE, OCCUPIED)
    assert grid.log_odds == pytest.approx(expected, abs=1e-6)
    known = expected != 0.0
    assert grid.p[known] == pytest.approx(1.0 / (1.0 + np.exp(-expected[known])), abs=1e-6)
    assert (grid.p[~known] == 0.0).all()


@both_maps
def test_log_odds_stop_at_the_ceiling_and_scans_add_up(kernels):
    grid = level(5, 6, 1.0)
    for number in range(1, 40):
        kernels.insert(grid, column(4.0, 0.0), 1, IDENTITY, IDENTITY, number, UPDATE)
    assert 50.0 <= grid.log_odds[0, 4] < 50.0 + OCCUPIED
    assert grid.log_odds[0, 1] == pytest.approx(39 * FREE, rel=1e-5)
    for number in range(40, 200):  # what stood there is gone
        kernels.insert(grid, column(5.0, 0.0), 1, IDENTITY, IDENTITY, number, UPDATE)
    assert grid.log_odds[0, 4] < -5.0 and grid.p[0, 4] < 0.01


@both_maps
def test_beams_that_leave_the_grid_are_skipped_whole(kernels):
    grid = level(5, 5, 1.0)
    kernels.insert(grid, column(9.0, 0.0), 1, IDENTITY, IDENTITY, 1, UPDATE)
    kernels.insert(grid, column(11.0, 0.0), 1, Pose2(-9.0, 0.0, 0.0), IDENTITY, 2, UPDATE)
    near = np.array([[9.0, 0.2], [0.0, 0.0]])  # ends where it begins, behind one that leaves
    kernels.insert(grid, near, 2, IDENTITY, IDENTITY, 3, UPDATE)
    assert not grid.log_odds.any()


def test_the_originals_map_does_not_grow_and_halves_from_level_to_level():
    slam = Original(OriginalParams(map_size=100, levels=3))
    slam.update(scan_at((0, 0, 0)))
    known = np.isfinite(slam.map().p)
    assert known.shape <= (100, 100)
    assert known[[0, -1]].any(axis=1).all() and known[:, [0, -1]].any(axis=0).all()  # no margin
    assert [grid.p.shape[0] for grid in slam._map.levels] == [100, 50, 25]
    assert [grid.resolution for grid in slam._map.levels] == [0.05, 0.1, 0.2]


def test_prediction_by_velocity_odometry_gyro_or_not_at_all():
    for source, odometry, yaw, expected in (
        ("last", None, None, (1.0, 0.0, 0.0)),
        ("velocity", None, None, (2.0, 0.0, 0.0)),
        ("velocity", 1, None, (2.0, 0.0, 0.0)),
        ("auto", 1, None, (1.0, 0.5, 0.2)),
        ("velocity", None, 0.3, (2.0, 0.0, 0.3)),
    ):
        motion = Motion(source)
        frames = [Pose2(5.0, 5.0, 0.0), Pose2(6.0, 5.0, 0.0), Pose2(6.0, 5.5, 0.2)]
        yaws = [0.0, 0.0, yaw]
        pose = IDENTITY
        for k in range(2):
            scan = stamped(0.1 * k, odometry and frames[k], yaw and yaws[k])
            assert motion.predict(pose, scan) is not None
            pose = Pose2(float(k), 0.0, 0.0)
            motion.correct(pose, scan)
        scan = stamped(0.2, odometry and frames[2], yaw and yaws[2])
        assert motion.predict(pose, scan) == pytest.approx(expected)
        used = (2 if source == "auto" else 0, 2 if yaw else 0)
        assert (motion.odometry, motion.gyro) == used


def test_prediction_scales_with_the_interval_until_stamps_prove_ragged():
    steady, ragged = 0.1 * np.arange(3), np.cumsum(15 * [0.35, 0.05])
    for stamps, later, step in ((steady, 0.2, 0.2), (ragged, 0.35, 0.1)):
        motion, pose = Motion("auto"), IDENTITY
        for k, t in enumerate(stamps.tolist()):
            motion.predict(pose, stamped(t))
            pose = Pose2(0.1 * k, 0.0, 0.0)
            motion.correct(pose, stamped(t))
        found = motion.predict(pose, stamped(t + later)).x
        assert found - pose.x == pytest.approx(step)
