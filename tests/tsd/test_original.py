"""tsd@original: the published kernels against naive twins, and its modes."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial import KDTree

from slams.types import IDENTITY, Pose2
from tests.rooms import box, cast, drive, error, laser, scan_at
from tests.tsd import naive as naive_tsd
from tests.tsd.cases import original
from tsd.original import Original, OriginalParams
from tsd.original.map import TsdGrid, zero_crossings
from tsd.original.map_kernels import allocate, cast_rays
from tsd.original.match_kernels import closed_form, move, score_pdf
from tsd.original.registration import reciprocal_pairs
from tsd.original.scan_kernels import Sensor, mask_scan, oriented_normals


@pytest.fixture(scope="module")
def pushed():
    lidar = laser(541)
    sensor = Sensor(lidar.angle_min, lidar.angle_increment, 0.001, 30.0, 2.0, 32.0, 0.01)
    pose, walls = (0.1, -0.2, 0.3), np.array(box(-2.0, -2.2, 2.3, 2.0))
    ranges = cast(walls, pose, lidar)
    grid = TsdGrid(0.05, 0.15, 128, True)
    grid.push(np.array(pose), ranges, np.ones(len(ranges), np.bool_), sensor)
    return grid.kernel, sensor, pose, ranges, lidar


def test_push_equals_the_naive_twin(pushed):
    kernel, _, pose, ranges, lidar = pushed
    twin = naive_tsd.push_once(
        kernel.tsd.shape, kernel.corner, kernel.cell, 0.15, pose, ranges, lidar.angles, 0.01
    )
    cells = np.kron(kernel.allocated, np.ones((32, 32), bool))
    assert cells.sum() > 4000
    assert np.allclose(kernel.tsd[cells], twin[cells], atol=1e-5, equal_nan=True)


def test_cells_of_a_partition_that_was_empty_are_free_and_no_others():
    kernel = TsdGrid(0.05, 0.15, 128, True).kernel
    kernel.emptiness[1, 2] = 5.0
    allocate(kernel, 1, 2)
    expected = np.zeros(kernel.weight.shape)
    expected[32:64, 64:96] = 5.0
    np.testing.assert_array_equal(kernel.weight, expected)
    np.testing.assert_array_equal(kernel.allocated.nonzero(), [[1], [2]])


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


def test_a_ray_that_meets_a_wall_from_behind_finds_nothing(pushed):
    kernel, sensor, *_ = pushed
    points, mask = np.zeros((541, 2)), np.zeros(541, np.bool_)
    cast_rays(kernel, np.array((2.36, 0.0, math.pi)), sensor, points, mask)
    assert not mask[220:321].any()  # the wall across the room is in range


def test_mask_drops_short_jumps_and_nan():
    lidar = laser(9, fov=0.08)
    sensor = Sensor(lidar.angle_min, lidar.angle_increment, 0.001, 30.0, 2.0, 32.0, 0.01)
    ranges = np.array([2.0, 2.0, 5.0, 5.0, np.inf, np.nan, 0.1, 2.0, 2.0], np.float32)
    ranges.flags.writeable = False
    out, mask = np.zeros(9), np.zeros(9, np.bool_)
    mask_scan(ranges, sensor, 0.26, math.radians(3), out, mask)
    assert mask.tolist() == [True, True, False, True, True, False, False, False, True]
    assert math.isinf(out[5]) and out[6] == 0.0


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


@pytest.mark.parametrize("mode", ["icp", "tsd"])
def test_every_published_mode_follows_a_drive(mode):
    slam = original(registration=mode, trials=20)
    log = drive(n=12).select(odometry=False)
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


def test_original_ignores_the_times_of_beams():
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


def test_pairs_equal_the_naive_twin():
    rng = np.random.default_rng(4)
    model = rng.uniform(-2, 2, (300, 2))
    scene = model[rng.permutation(300)[:250]] + rng.normal(0.0, 0.03, (250, 2))
    for gate in (0.4, 0.1, 0.05):
        paired, partners = reciprocal_pairs(KDTree(model), scene, gate)
        found = np.full(300, -1)
        found[paired] = partners
        assert np.array_equal(found, naive_tsd.matched_pairs(model, scene, gate))


def test_the_closed_form_is_the_motion_between_pairs():
    motion, scene = Pose2(0.3, -0.2, 0.4), np.random.default_rng(0).uniform(-3, 4, (50, 2))
    moved = scene.copy()
    move(moved, motion)
    assert moved == pytest.approx(motion.transform(scene))
    assert closed_form(moved, scene) == pytest.approx(motion)


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


def test_zero_crossings_take_the_nearer_cell():
    tsd = np.array([[0.9, 0.3, -0.7, np.nan, 0.2]], np.float32)
    assert zero_crossings(tsd).tolist() == [[False, True, False, False, False]]


def test_normals_face_the_laser_and_corners_have_none():
    lidar = laser(361)
    points = cast(np.array(box(-2.0, -2.0, 2.0, 2.0)), (0, 0, 0), lidar)[:, None] * lidar.directions
    phi = np.zeros(361)
    oriented_normals(points, np.ones(361, np.bool_), phi)
    assert phi[180] == pytest.approx(math.pi) or phi[180] == pytest.approx(-math.pi)
    corner = int(np.argmin(np.abs(lidar.angles - math.pi / 4)))
    assert math.isnan(phi[corner]) and math.isnan(phi[0])
