import math

import numpy as np
import pytest

from gmapping import GMappingParams
from gmapping.original import Original, OriginalParams
from gmapping.original.map import HitMap
from gmapping.original.match_kernels import hill_climb, log_likelihood, score
from gmapping.original.motion import Step as OriginalStep
from gmapping.original.scan import EndPoints as OriginalPoints
from slams.geometry import travelled
from slams.scan.end_points import EndPoints
from slams.types import IDENTITY, Laser, Pose2
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
    step, particles = OriginalStep(Pose2(0.5, -0.2, 0.3), 0.1, True), slam.particles
    slam._move(step)
    assert slam.pose == IDENTITY @ step.pose
    expected = [
        0.1 * (0.5 + 0.06) + 0.03,
        0.1 * (0.2 + 0.15) + 0.03,
        0.06 + 0.2 * math.hypot(0.5, 0.2),
    ]
    np.testing.assert_allclose(particles.poses.mean(axis=0), step.pose, atol=0.004)
    np.testing.assert_allclose(particles.poses.std(axis=0), expected, rtol=0.03)


def test_the_originals_beams_are_half_a_beam_off_and_not_those_of_its_picture():
    step, scan = OriginalStep(IDENTITY, 0.0, True), seen(IDENTITY)
    off, true = (OriginalPoints(OriginalParams(), offset)(scan, step) for offset in (-0.5, 0.0))
    turned = np.arctan2(off[:, 1], off[:, 0]) - np.arctan2(true[:, 1], true[:, 0])
    np.testing.assert_allclose(turned, -0.5 * LASER.angle_increment, atol=1e-9)
    np.testing.assert_allclose(true, scan.ranges[:, None] * LASER.directions, atol=1e-6)
    slam = Original(OriginalParams())
    slam.update(scan)
    np.testing.assert_array_equal(slam._rays(scan, step), true)
    np.testing.assert_array_equal(slam._points(scan, step), off)


@pytest.mark.parametrize("seconds", [0.0, 0.5])
@pytest.mark.parametrize("way", [Pose2(0.3, -0.1, 0.0), Pose2(0.0, 0.0, 0.2)])
def test_the_originals_sweep_is_taken_out_as_the_defaults_is(seconds, way):
    laser = Laser(-2.0, 0.02, 200, 0.1, 30.0, Pose2(0.2, 0.1, 0.4), time_increment=0.001)
    scan, params = seen(IDENTITY, laser=laser), OriginalParams(deskew=True)
    found = OriginalPoints(params, 0.0)(scan, OriginalStep(way, seconds, True))
    velocity = Pose2(*(v / seconds if seconds else 0.0 for v in way))
    ours = EndPoints(GMappingParams()).take(scan, velocity)
    middle = travelled(velocity, 0.5 * laser.sweep_time)  # there ours are, the original's at first
    assert ours.n == len(found)
    np.testing.assert_allclose(middle.transform(ours.points[:2, : ours.n].T), found, atol=1e-9)


def test_a_robot_at_rest_gets_no_noise_from_the_original():
    slam = Original(OriginalParams(n_particles=10))
    slam._move(OriginalStep(IDENTITY, 0.1, True))
    assert not slam.particles.poses.any()
