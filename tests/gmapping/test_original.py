import math
from dataclasses import replace

import numpy as np
import pytest

from gmapping.original import Original, OriginalParams
from gmapping.original.map import HitMap
from gmapping.original.match_kernels import hill_climb, log_likelihood, nearest, score
from gmapping.original.motion import Motion
from gmapping.original.scan import end_points
from gmapping.tile_kernels import cell_of
from slams.types import IDENTITY, Laser, Pose2, Scan
from tests.gmapping import naive
from tests.gmapping.scenes import CLIMB, LASER, seen


@pytest.fixture(scope="module")
def hits():
    rng = np.random.default_rng(1)
    points, hit_map = rng.uniform(-0.5, 0.5, (60, 2)), HitMap(OriginalParams(max_tiles=500), 1)
    assert hit_map.insert(points, np.zeros((1, 3)))
    return hit_map.tiles, points


def test_score_and_likelihood_equal_the_naive_twin(hits):
    tiles, points = hits
    cells = naive.hit_map(points[:, :2], 0.05)
    pose = np.array([0.03, -0.02, 0.1])
    there = naive.moved(pose, points[:, :2])
    expected = naive.score(cells, there, 0.05, 0.05)
    assert score(tiles, 0, pose, points, 0.05, -1.0) == pytest.approx(expected, rel=1e-5)
    expected = naive.log_likelihood(cells, there, 0.05, 0.075, 0.5)
    assert log_likelihood(tiles, 0, pose, points, CLIMB) == pytest.approx(expected, rel=1e-5)


def test_the_nearest_hit_is_that_of_the_cells_around(hits):
    tiles, points = hits
    cells = naive.hit_map(points, 0.05)
    for x, y in np.random.default_rng(2).uniform(-0.6, 0.6, (200, 2)):
        expected = naive.nearest2(cells, np.array((x, y)), 0.05)
        found = nearest(tiles, 0, cell_of(x, 0.05), cell_of(y, 0.05), x, y)
        assert found == pytest.approx(math.inf if expected is None else expected, abs=1e-6)


def test_the_climb_stops_at_the_finest_step_and_never_gets_worse(hits):
    tiles, points = hits
    pose = np.array([0.03, 0.02, 0.02])
    before = score(tiles, 0, pose, points, 0.05, -1.0)
    found = hill_climb(tiles, 0, points, CLIMB, pose)
    assert found > before
    assert found == score(tiles, 0, pose, points, 0.05, -1.0)
    assert np.abs(pose).max() < 0.004


def test_motion_noise_has_the_originals_moments():
    slam = Original(OriginalParams(n_particles=20_000, seed=5))
    step, particles = Pose2(0.5, -0.2, 0.3), slam.particles
    slam._move(step)
    assert slam.pose == IDENTITY @ step
    expected = [
        0.1 * (0.5 + 0.06) + 0.03,
        0.1 * (0.2 + 0.15) + 0.03,
        0.06 + 0.2 * math.hypot(0.5, 0.2),
    ]
    np.testing.assert_allclose(particles.poses.mean(axis=0), step, atol=0.004)
    np.testing.assert_allclose(particles.poses.std(axis=0), expected, rtol=0.03)


def test_the_originals_beams_are_half_a_beam_off_and_not_those_of_its_picture():
    scan, params = seen(IDENTITY), OriginalParams(n_particles=1, max_tiles=500)
    (off, far), (true, _) = (end_points(scan, offset, params.max_range) for offset in (-0.5, 0.0))
    turned = np.arctan2(off[:, 1], off[:, 0]) - np.arctan2(true[:, 1], true[:, 0])
    np.testing.assert_allclose(turned, -0.5 * LASER.angle_increment, atol=1e-9)
    np.testing.assert_allclose(true, scan.ranges[:, None] * LASER.directions, atol=1e-6)
    assert far == pytest.approx(scan.ranges.max())
    slam, maps = Original(params), HitMap(params, 1)
    slam.update(scan)
    assert maps.insert(off, np.zeros((1, 3)))
    np.testing.assert_array_equal(slam.tiles.tiles.cells, maps.tiles.cells)
    np.testing.assert_array_equal(slam._renderer._keyframes[0][:-1], true)


def test_a_range_counts_from_range_min_up_to_below_the_longest():
    ranges = np.array([0.1, 0.09, 2.0, 30.0, 29.0, np.inf, np.nan], np.float32)
    laser = Laser(0.0, 0.1, 7, float(ranges[0]), 30.0)
    points, far = end_points(Scan(0.0, ranges, laser), 0.0, 80.0)
    np.testing.assert_allclose(np.hypot(*points.T), [0.1, 2.0, 29.0], rtol=1e-6)
    assert far == pytest.approx(29.0)
    assert len(end_points(Scan(0.0, ranges, laser), 0.0, 2.0)[0]) == 1


@pytest.mark.parametrize("threshold", [0.0, 1.0])
def test_the_original_resamples_below_a_share_of_effective_particles(threshold):
    slam = Original(OriginalParams(n_particles=5, max_tiles=500, resample_threshold=threshold))
    for pose in (IDENTITY, Pose2(1.1, 0.0, 0.0)):  # far enough for a keyframe
        slam.update(replace(seen(pose), odometry=pose))
    assert slam.report()["inserted"] == 2
    assert slam.report()["resampled"] == threshold


def test_motions_are_those_of_the_odometry_also_where_a_gyro_differs():
    motion, ranges = Motion(OriginalParams()), np.ones(LASER.n_beams, np.float32)
    for k in range(3):
        step = motion.step(Scan(0.1 * k, ranges, LASER, Pose2(0.1 * k, 0.0, 0.0), 0.1 * k))
    assert step == pytest.approx((0.1, 0.0, 0.0))
    assert motion.used == {"odometry": 2, "odometry_jumps": 0}


def test_a_robot_at_rest_gets_no_noise_from_the_original():
    slam = Original(OriginalParams(n_particles=10))
    slam._move(IDENTITY)
    assert not slam.particles.poses.any()
