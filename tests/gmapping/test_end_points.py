"""The preset `paper`: maps of mean hits, the climb, the Gaussian of samples."""

import math

import numpy as np
import pytest

from gmapping import GMappingParams
from gmapping.climb_kernels import HitModel, climb, distance_cost, log_posterior, sample
from gmapping.end_points import EndPointMatcher
from gmapping.hit_kernels import N_HIT_VALUES, insert_ends
from gmapping.map import TileMap
from gmapping.tile_kernels import cell_of, index_in_tile, slot_of
from slams import geometry
from slams.types import IDENTITY, Pose2
from tests.gmapping.scenes import drive, position_error, posterior, run, surface_of, view_of

EDGE = 0.05
MODEL = HitModel(4000.0, 0.1, 0.01, 0.005, 3)
THERE = np.array([0.012, -0.008, 0.006])


def tiles_of(ends, n=1, poses=None, cap=100.0):
    tiles = TileMap(n, 1, EDGE, 5000, n_values=N_HIT_VALUES).tiles
    poses = np.zeros((n, 3)) if poses is None else np.array(poses, float)
    assert insert_ends(tiles, poses, ends, cap) == 0
    return tiles


def ends_of(points, beams=1.0):
    """Rows x, y, two that are not used, beams."""
    points = np.asarray(points, float)
    return np.column_stack([points, np.full((len(points), 2), np.nan), np.full(len(points), beams)])


def cell(tiles, x, y, particle=0):
    ix, iy = cell_of(x, EDGE), cell_of(y, EDGE)
    return tiles.cells[slot_of(tiles, particle, 0, ix, iy), index_in_tile(ix, iy)]


def matched(tiles, ends, start, information, model=MODEL, mean=(0.0, 0.0, 0.0)):
    """Peak (3,), log posterior there, mean (3,), covariance (3, 3), log eta."""
    of, poses = posterior(tiles, ends, [mean], information), np.array([start], float)
    value, covariance = np.zeros(1), np.zeros((1, 3, 3))
    climb(of, model, poses, value)
    peak, best = poses[0].copy(), value[0]
    sample(of, model, poses, covariance, value)
    return peak, best, poses[0], covariance[0], value[0]


def test_a_cell_keeps_the_weighted_mean_of_its_hits():
    tiles = tiles_of(ends_of([[0.31, 0.02], [0.29, -0.02]], beams=2.0))
    insert_ends(tiles, np.array([[0.01, 0.0, 0.0]]), ends_of([[0.3, 0.0]], beams=4.0), 5.0)
    np.testing.assert_allclose(cell(tiles, 0.3, 0.0)[:3], [0.305, 0.0, 5.0], atol=1e-6)
    insert_ends(tiles, np.zeros((1, 3)), ends_of([[0.315, 0.0]], beams=5.0), 5.0)
    np.testing.assert_allclose(cell(tiles, 0.3, 0.0)[:2], [0.31, 0.0], atol=1e-6)  # capped: half


def test_every_cell_keeps_the_nearest_mean_hit_around_it():
    rng = np.random.default_rng(3)
    ix, iy = np.divmod(rng.choice(400, 80, replace=False), 20)
    points = EDGE * np.column_stack([ix, iy]) + rng.uniform(-0.02, 0.02, (80, 2))
    tiles = tiles_of(ends_of(points))
    for jx in range(-1, 21):
        for jy in range(-1, 21):
            center, around = EDGE * np.array([jx, jy]), (abs(ix - jx) < 2) & (abs(iy - jy) < 2)
            here = cell(tiles, *center)
            if not around.any():
                assert here[5] == 0.0
            else:
                expected = np.hypot(*(points[around] - center).T).min()
                assert math.hypot(*(here[3:5] - center)) == pytest.approx(expected, abs=1e-5)


def test_the_cost_is_of_distances_to_mean_hits_and_a_beam_without_one_costs_the_most():
    tiles, far = tiles_of(ends_of([[1.0, 0.0]])), ends_of([[5.0, 5.0]], beams=3.0)
    near = ends_of([[1.01, 0.02]], beams=2.0)
    total, close = distance_cost(tiles, 0, np.zeros(3), near, 0.1, math.inf)
    assert total == pytest.approx(2.0 * 0.01 * 5e-4 / (0.01 + 5e-4), rel=1e-4) and close == 2.0
    moved = distance_cost(tiles, 0, np.array([-0.01, -0.02, 0.0]), near, 0.1, math.inf)
    assert moved[0] == pytest.approx(0.0, abs=1e-9)
    assert distance_cost(tiles, 0, np.zeros(3), far, 0.1, math.inf) == (pytest.approx(0.03), 0.0)
    assert distance_cost(tiles, 0, np.zeros(3), near, 0.02, math.inf)[1] == 0.0


def test_a_hit_counts_in_its_cell_and_in_the_eight_around():
    tiles = tiles_of(ends_of([[1.0, 0.0]]))
    for x in (-EDGE, 0.0, EDGE):
        for y in (-EDGE, 0.0, EDGE):
            ends, square = ends_of([[1.0 + x, y]]), x * x + y * y
            total, inliers = distance_cost(tiles, 0, np.zeros(3), ends, 0.1, math.inf)
            assert total == pytest.approx(0.01 * square / (0.01 + square), rel=1e-4)
            assert inliers == 1.0


def test_a_posterior_is_prior_and_likelihood_and_given_up_below_a_floor():
    ends = surface_of(IDENTITY)
    tiles, mean, known = tiles_of(ends), np.array([0.02, 0.0, 0.01]), np.diag([1e3, 2e3, 3e3])
    off = THERE - mean
    prior = (
        -0.5 * (geometry.STUDENT_DOF + 3.0) * math.log1p(off @ known @ off / geometry.STUDENT_DOF)
    )
    total, _ = distance_cost(tiles, 0, THERE, ends, MODEL.scale, math.inf)
    exact = prior - 0.5 * MODEL.information * total
    args = posterior(tiles, ends, [mean], known), MODEL, 0, THERE
    assert log_posterior(*args, -math.inf) == pytest.approx(exact)
    assert log_posterior(*args, exact - 1.0) == pytest.approx(exact)
    assert log_posterior(*args, exact + 1.0) <= exact + 1.0
    assert log_posterior(*args, 0.0) <= 0.0


def test_the_climb_finds_the_peak_to_its_last_step():
    ends = surface_of(IDENTITY)
    peak, best, mean, *_ = matched(tiles_of(ends), ends, THERE, np.eye(3))
    assert np.abs(peak).max() <= 0.01 / 2**3 + 1e-9
    np.testing.assert_allclose(mean, 0.0, atol=1e-3)
    coarse = matched(tiles_of(ends), ends, THERE, np.eye(3), MODEL._replace(halvings=0))
    assert coarse[1] < best and np.abs(coarse[0] - THERE).max() > 0.0


def test_without_any_hit_the_samples_have_the_prior():
    known = np.linalg.inv(np.diag([0.02, 0.01, 0.03]) ** 2)
    tiles = tiles_of(ends_of([[0.0, 0.0]]))
    mean = (0.1, -0.2, 0.05)
    far = ends_of([[50.0, 0.0]])
    _, best, found, covariance, eta = matched(tiles, far, mean, known, mean=mean)
    np.testing.assert_allclose(found, mean, atol=1e-4)
    # Student's law of the prior is narrower at its middle than its covariance: 6 / 3 of it
    np.testing.assert_allclose(covariance @ known, 0.5 * np.eye(3), atol=0.05)
    wide = matched(tiles, far, mean, known / 4.0, mean=mean)
    assert wide[4] - eta == pytest.approx(math.log(8.0), abs=0.5)  # the prior is not normalized
    assert best == pytest.approx(-0.5 * MODEL.information * 0.01)


def test_the_preset_tracks_resamples_and_has_nothing_of_ours_behind():
    truth, scans = drive(120)
    slam, poses = run(scans, "paper", n_particles=8)
    assert position_error(poses, truth).max() < 0.04
    assert slam.params.spread == 1.0 and not slam.params.refine
    assert slam.params.estimator == "plain" and slam.report()["matched"] == 120
    assert slam.report()["resampled"] > 0
    assert isinstance(slam._matcher, EndPointMatcher)


def test_a_match_has_inlier_ratio_and_information_without_the_prior():
    params = GMappingParams(refine=False, n_particles=1, max_tiles=5000)
    matcher, view = EndPointMatcher(params), view_of(IDENTITY)
    assert matcher.insert(view, np.zeros((1, 3)), 1.0)
    weak, strong = (
        matcher.match(view, 0, geometry.Prior(IDENTITY, k * np.eye(3)), Pose2(*THERE))
        for k in (1.0, 1e7)
    )
    np.testing.assert_allclose(weak.pose, 0.0, atol=1e-3)
    assert weak.inlier_ratio == pytest.approx(1.0, abs=0.02)
    assert (np.linalg.eigvalsh(weak.information) > 1e3).all()
    np.testing.assert_allclose(np.diag(strong.information), np.diag(weak.information), rtol=0.5)
    far = Pose2(0.7, 0.4, 0.3)
    assert matcher.match(view, 0, geometry.Prior(far, 1e9 * np.eye(3)), far).inlier_ratio < 0.5


def test_the_nearest_mean_moves_with_the_cell_it_is_of():
    tiles = tiles_of(ends_of([[0.30, 0.0]]))
    insert_ends(tiles, np.zeros((1, 3)), ends_of([[0.32, 0.01]]), 100.0)
    for x, y in ((0.3, 0.0), (0.25, 0.05), (0.35, -0.05)):
        np.testing.assert_allclose(cell(tiles, x, y)[3:5], [0.31, 0.005], atol=1e-6)
    assert slot_of(tiles, 0, 0, cell_of(0.45, EDGE), 0) == 0 or cell(tiles, 0.45, 0.0)[5] == 0.0


def test_each_particle_climbs_in_its_own_map():
    ends = surface_of(IDENTITY)
    tiles = tiles_of(ends, 2, [[0.0, 0.0, 0.0], [0.01, -0.01, 0.0]])
    poses, value = np.zeros((2, 3)), np.zeros(2)
    climb(posterior(tiles, ends, np.zeros((2, 3)), 1.0, (1, 0)), MODEL, poses, value)
    np.testing.assert_allclose(poses, [[0.01, -0.01, 0.0], [0.0, 0.0, 0.0]], atol=1.3e-3)


def test_samples_have_the_curvature_of_the_posterior():
    ends, known = surface_of(IDENTITY), np.diag([1e4, 1e4, 1e4])
    tiles = tiles_of(ends)
    of = posterior(tiles, ends, [np.zeros(3)], known)
    model = MODEL._replace(information=20.0)  # so wide that no cell's border is felt
    peak, best, _, covariance, eta = matched(tiles, ends, np.zeros(3), known, model)
    for axis in range(3):
        off = np.zeros(3)
        off[axis] = math.sqrt(1.0 / np.linalg.inv(covariance)[axis, axis])
        sides = [log_posterior(of, model, 0, peak + s * off, -math.inf) for s in (-1.0, 1.0)]
        drop = best - np.mean(sides)
        assert drop == pytest.approx(0.5, abs=0.3)
    volume = 0.5 * math.log(np.linalg.det(2.0 * math.pi * covariance))
    assert eta - best == pytest.approx(volume, abs=0.2)  # Laplace's, but for lattice and tails
