"""The steps of `Hector.update`, one by one: each is taken where it is due, and only there."""

import numpy as np
import pytest

from hector import HectorParams, match_kernels
from hector.map import BLUR, FINE, ROUGH, LogOddsPyramid
from hector.map_kernels import probability
from hector.match_kernels import Solver, gauss_newton, normal_equations
from slams.geometry import Prior
from slams.refine.lines import ENOUGH
from slams.scan.end_points import gap
from slams.types import IDENTITY, Pose2
from tests.rooms import settled


def test_one_step_of_gauss_newton_is_damped_and_limited():
    slam = settled("hector", 3)
    level, points, start = slam._map.levels[0], slam._scan, Pose2(0.03, -0.02, 0.01)
    H, b = np.zeros((3, 3)), np.zeros(3)
    normal_equations(level, points.points, points.n, 1, start, H, b)
    nothing = Prior(IDENTITY, np.zeros((3, 3)))
    for damping in (0.0, 0.5):
        one = Solver(1, 9.0, 9.0, 0.0, damping, 1)
        pose, _, _ = gauss_newton(level, points.points, points.n, start, nothing, one, 0.0 * H)
        step = np.linalg.solve(H + damping * np.diag(np.diag(H)), b)
        assert np.array(pose) - np.array(start) == pytest.approx(step, rel=1e-6)
    short = Solver(1, 0.5 * np.hypot(*step[:2]), 0.5 * abs(step[2]), 0.0, damping, 1)
    pose, _, _ = gauss_newton(level, points.points, points.n, start, nothing, short, 0.0 * H)
    assert np.array(pose) - np.array(start) == pytest.approx(0.5 * step, rel=1e-6)


def test_what_cells_say_is_never_surer_than_their_ridges_are_exact(monkeypatch):
    slam = settled("hector", 12)
    prior = Prior(IDENTITY, 1e4 * np.eye(3))
    points, grids = slam._scan, slam._map
    found = grids.climb(points, IDENTITY, prior)
    level, solver = grids.levels[0], grids._solvers(points.n // ENOUGH)[0]
    H = np.zeros((3, 3))
    _, _, square = gauss_newton(level, points.points, points.n, found.pose, prior, solver, H)
    assert found.seen == pytest.approx(H / max(square, BLUR), rel=0.05, abs=1.0)
    assert found.seen[0, 0] > 5.0 * H[0, 0]
    monkeypatch.setattr(match_kernels, "climb", lambda *_: (tuple(IDENTITY), 1.0, 0.0))
    assert grids.climb(points, IDENTITY, prior).seen == pytest.approx(grids._H / BLUR)


def test_two_poses_are_apart_as_the_ends_half_way_out_see_it():
    points = settled("hector", 1)._scan
    points.far = 8.0
    for other, apart in ((Pose2(0.3, 0.4, 0.0), 0.5), (Pose2(0.0, 0.0, -0.1), 0.4)):
        assert gap(points, IDENTITY, other) == pytest.approx(apart)
    across = gap(points, Pose2(0.0, 0.0, 3.1), Pose2(0.0, 0.0, -3.1))
    assert across == pytest.approx(4.0 * (2.0 * np.pi - 6.2))


@pytest.mark.parametrize(
    ("n", "refine", "strides"),
    [
        (1080, True, [4, 4, 4]),
        (400, True, [2, 2, 2]),
        (90, True, [1, 1, 1]),
        (1080, False, [1, 2, 4]),  # the paper alone leaves no beam out on its finest level
        (90, False, [1, 1, 1]),
    ],
)
def test_fewer_beams_are_climbed_with_where_there_are_many(n, refine, strides):
    params = HectorParams(refine=refine)
    solvers = [Solver(*one) for one in LogOddsPyramid(params)._solvers(n // ENOUGH)]
    assert [solver.stride for solver in solvers] == strides
    for level, (solver, stride) in enumerate(zip(solvers, strides, strict=True)):
        rough = ROUGH if refine and stride > 1 else FINE
        exact = not refine and level == 0
        expected = params.converged if exact else rough * 0.05 * 2**level
        assert solver.tolerance == pytest.approx(expected)


def test_what_was_never_seen_has_no_probability():
    assert [round(float(probability(x)), 4) for x in (0.0, 1.0, -1.0)] == [0.0, 0.7311, 0.2689]


def test_a_pyramid_that_has_grown_is_climbed_as_before():
    slam = settled("hector", 3, max_cells=1 << 20)
    grids, loose = slam._map, Prior(IDENTITY, 1e-3 * np.eye(3))
    start, before = Pose2(0.1, -0.05, 0.04), [level.p.shape for level in grids.levels]
    found = grids.climb(slam._scan, start, loose)
    grids._cover(Pose2(0.0, -70.0, 0.0), 5.0)
    assert all(a.p.shape > b for a, b in zip(grids.levels, before, strict=True))
    assert grids.climb(slam._scan, start, loose).pose == pytest.approx(found.pose, abs=1e-9)
    assert found.pose == pytest.approx(IDENTITY, abs=0.03)
