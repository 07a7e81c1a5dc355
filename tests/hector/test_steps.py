"""The steps of `Hector.update`, one by one."""

import math

import numpy as np
import pytest

from hector import HectorParams, match_kernels
from hector.map import (
    LEVEL_TOLERANCE,
    MIN_RESIDUAL_VARIANCE,
    TOLERANCE_BEFORE_LINES,
    LogOddsPyramid,
)
from hector.match_kernels import Solver, gauss_newton, normal_equations
from slams.geometry import Prior
from slams.refine.lines import MIN_USED_BEAMS
from slams.scan.end_points import EndPoints, pose_distance
from slams.types import IDENTITY, Pose2
from tests.rooms import NOTHING, calls, drive, laser, made, scan_at, settled


def test_one_step_of_gauss_newton_is_damped_and_limited():
    slam = settled("hector", 3)
    level, points, start = slam._map.levels[0], slam._scan, Pose2(0.03, -0.02, 0.01)
    H, b = np.zeros((3, 3)), np.zeros(3)
    normal_equations(level, points.points, points.n, 1, start, H, b)
    for damping in (0.0, 0.5):
        one = Solver(1, 9.0, 9.0, 0.0, damping, 1)
        pose, _, _ = gauss_newton(level, points.points, points.n, start, NOTHING, one, 0.0 * H)
        step = np.linalg.solve(H + damping * np.diag(np.diag(H)), b)
        assert np.array(pose) - np.array(start) == pytest.approx(step, rel=1e-6)
    short = Solver(1, 0.5 * np.hypot(*step[:2]), 0.5 * abs(step[2]), 0.0, damping, 1)
    pose, _, _ = gauss_newton(level, points.points, points.n, start, NOTHING, short, 0.0 * H)
    assert np.array(pose) - np.array(start) == pytest.approx(0.5 * step, rel=1e-6)


def test_a_step_that_leaves_a_saturated_wall_is_undone():
    p = np.zeros((60, 60), np.float32)
    for walls in (p, p.T):
        walls[50, 10:50], walls[51, 10:50] = 0.985, 0.99
    level = settled("hector", 1)._map.levels[0]._replace(p=p, x0=0.0, y0=0.0, resolution=1.0)
    along, across, H = np.arange(15.0, 45.0), np.full(30, 50.3), np.zeros((3, 3))
    points = np.array((np.append(along, across), np.append(across, along)))
    solver = Solver(12, 9.0, 0.2, 1e-3, 1e-3, 1)
    pose, *found = gauss_newton(level, points, 60, IDENTITY, NOTHING, solver, H)
    expected = normal_equations(level, points, 60, 1, pose, 0.0 * H, np.zeros(3))
    assert found == pytest.approx(expected)
    assert found[0] > 0.98


def test_pose_distance_adds_the_rotation_at_half_of_the_radius():
    points = settled("hector", 1)._scan
    points.radius = 8.0
    for other, apart in ((Pose2(0.3, 0.4, 0.0), 0.5), (Pose2(0.0, 0.0, -0.1), 0.4)):
        assert pose_distance(points, IDENTITY, other) == pytest.approx(apart)
    across = pose_distance(points, Pose2(0.0, 0.0, 3.1), Pose2(0.0, 0.0, -3.1))
    assert across == pytest.approx(4.0 * (2.0 * np.pi - 6.2))


LOOSE = Prior(IDENTITY, 1e-3 * np.eye(3))
MOVED = Pose2(0.03, -0.02, 0.01)


def mapped(beams):
    """A map of the room from its middle, and a scan that is taken a little off it."""
    params = HectorParams()
    grids, points = LogOddsPyramid(params), EndPoints(params)
    points.read(scan_at(IDENTITY, laser(beams)), IDENTITY)
    for _ in range(3):
        grids.insert(points, IDENTITY)
    return grids, points.read(scan_at(MOVED, laser(beams)), IDENTITY)


def test_the_last_steps_on_the_lines_use_all_beams(monkeypatch):
    grids, points = mapped(1081)
    quick = grids.lines.fit(points, IDENTITY, LOOSE)
    monkeypatch.setattr("slams.refine.lines.MAX_BEAM_STRIDE", 1)
    thorough = grids.lines.fit(points, IDENTITY, LOOSE)
    assert quick.pose == pytest.approx(thorough.pose, abs=2e-4)
    assert quick.inlier_ratio == pytest.approx(thorough.inlier_ratio, abs=0.01)
    fits = (quick, thorough)
    found, expected = (fit.information * fit.mean_square * fit.design_effect for fit in fits)
    assert found == pytest.approx(expected, rel=0.05, abs=0.05 * expected[2, 2])


@pytest.mark.parametrize(("rate", "looks"), [(10.0, 40), (40.0, 10)])
def test_noise_is_measured_every_tenth_of_a_second(rate, looks, monkeypatch):
    slam = made("hector")
    first, *scans = drive(n=41, rate=rate)
    slam.update(first)
    learned = calls(monkeypatch, slam._scan._noise._std, "add")
    for scan in scans:
        slam.update(scan)
    assert len(learned) == pytest.approx(looks, abs=1)


def test_log_odds_of_a_free_cell_still_fall_where_its_probability_is_negligible():
    grids, points = mapped(361)
    for _ in range(40):
        grids.insert(points, IDENTITY)
    level = grids.levels[0]
    free = level.log_odds[level.log_odds < 0.0]
    assert free.min() == pytest.approx(43 * math.log(0.4 / 0.6), rel=1e-4)
    exact = 1.0 / (1.0 + np.exp(-level.log_odds))
    np.testing.assert_allclose(level.p, np.where(level.log_odds == 0.0, 0.0, exact), atol=1e-4)


def test_information_of_cells_is_limited_by_a_residual_variance(monkeypatch):
    slam = settled("hector", 12)
    prior = Prior(IDENTITY, 1e4 * np.eye(3))
    points, grids = slam._scan, slam._map
    found = grids.climb(points, IDENTITY, prior)
    level, solver = grids.levels[0], grids._solvers(points.n // MIN_USED_BEAMS)[0]
    H = np.zeros((3, 3))
    _, _, square = gauss_newton(level, points.points, points.n, found.pose, prior, solver, H)
    variance = max(square, MIN_RESIDUAL_VARIANCE)
    assert found.information == pytest.approx(H / variance, rel=0.05, abs=1.0)
    assert found.information[0, 0] > 5.0 * H[0, 0]
    monkeypatch.setattr(match_kernels, "climb", lambda *_: (tuple(IDENTITY), 1.0, 0.0))
    largest = grids._H / MIN_RESIDUAL_VARIANCE
    assert grids.climb(points, IDENTITY, prior).information == pytest.approx(largest)


@pytest.mark.parametrize(
    ("n", "refine", "strides"),
    [
        (1080, True, [4, 4, 4]),
        (400, True, [2, 2, 2]),
        (90, True, [1, 1, 1]),
        (1080, False, [1, 2, 4]),  # hector@paper uses all beams on its finest level
        (90, False, [1, 1, 1]),
    ],
)
def test_scans_of_many_beams_are_matched_to_the_pyramid_by_a_part_of_them(n, refine, strides):
    params = HectorParams(refine=refine)
    solvers = [Solver(*one) for one in LogOddsPyramid(params)._solvers(n // MIN_USED_BEAMS)]
    assert [solver.stride for solver in solvers] == strides
    for level, (solver, stride) in enumerate(zip(solvers, strides, strict=True)):
        relative = TOLERANCE_BEFORE_LINES if refine and stride > 1 else LEVEL_TOLERANCE
        exact = not refine and level == 0
        expected = params.converged if exact else relative * 0.05 * 2**level
        assert solver.tolerance == pytest.approx(expected)
