"""The pose graph against other solvers: its optimum, and its covariances along paths."""

import math

import numpy as np
import pytest
from scipy.optimize import least_squares

from slams.frontend.correlative import Window
from slams.loops import matching
from slams.loops import visibility_kernels as visibility
from slams.loops.graph import LoopEdge, PoseGraph
from slams.loops.matching import LocalMap, keyframe, read_end_points
from slams.refine.lines import Match
from slams.test_world import drive, laser, scan_at
from slams.types import IDENTITY, Pose2, Scan, wrap_angle

VARIANCES = np.array((0.02, 0.01, 0.005)) ** 2
INFORMATION = np.diag((1e3, 1e3, 1e4))


def ring(seed, n=40, loops=6):
    """A graph around a ring whose steps are wrong, and loops between its two laps."""
    rng = np.random.default_rng(seed)
    step = Pose2(0.5, 0.0, 4.0 * math.pi / n)
    graph, true = PoseGraph(), [IDENTITY]
    graph.append(IDENTITY, VARIANCES)
    for _ in range(n - 1):
        wrong = Pose2(*(rng.normal(size=3) * np.sqrt(VARIANCES)))
        graph.append(step @ wrong, VARIANCES)
        true.append(true[-1] @ step)
    for earlier in rng.choice(n // 2, loops, replace=False):
        later = int(earlier) + n // 2
        noise = Pose2(*(rng.normal(size=3) * (0.03, 0.03, 0.01)))
        pose = true[earlier].between(true[later]) @ noise
        graph.loops.append(LoopEdge(int(earlier), later, pose, INFORMATION))
    return graph


def residuals(flat, steps, loops):
    """Of all edges, whitened: what `PoseGraph` minimizes, written down once more."""
    poses = [IDENTITY, *(Pose2(*row) for row in flat.reshape(-1, 3))]
    out = []
    edges = [(k, k + 1, step, np.diag(1.0 / VARIANCES)) for k, step in steps]
    for i, j, pose, information in [*edges, *loops]:
        found = poses[i].between(poses[j])
        off = np.array(found) - np.array(pose)
        off[2] = wrap_angle(float(off[2]))
        out.append(np.sqrt(np.diag(information)) * off)
    return np.concatenate(out)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_optimum_is_that_of_another_solver(seed):
    graph = ring(seed)
    steps = [(k, graph.step(k, k + 1)) for k in range(graph.n - 1)]
    start = graph.poses[1:].copy().ravel()
    for _ in range(20):
        if graph.iterate() < 1e-9:
            break
    exact = dict.fromkeys(("xtol", "ftol", "gtol"), 1e-15)
    other = least_squares(residuals, start, args=(steps, graph.loops), method="lm", **exact)
    assert graph.pose(0) == pytest.approx(IDENTITY, abs=1e-9)
    found, expected = graph.poses[1:], other.x.reshape(-1, 3)
    assert np.abs(found[:, :2] - expected[:, :2]).max() < 1e-6
    assert np.abs(wrap_angle(found[:, 2] - expected[:, 2])).max() < 1e-6


def test_the_covariance_along_a_chain_is_that_of_drawn_chains():
    steps = [Pose2(1.0, 0.0, 0.3)] * 8
    graph = PoseGraph()
    graph.append(IDENTITY, VARIANCES)
    for step in steps:
        graph.append(step, VARIANCES)
    rng, ends = np.random.default_rng(5), []
    for _ in range(4000):
        pose = IDENTITY
        for step in steps:
            pose = pose @ (step @ Pose2(*(rng.normal(size=3) * 0.3 * np.sqrt(VARIANCES))))
        ends.append(pose)
    drawn = np.cov(np.array(ends).T) / 0.3**2
    assert graph.uncertainty(0)[8] == pytest.approx(drawn, rel=0.15, abs=1e-4)
    turn = PoseGraph()
    turn.append(IDENTITY, VARIANCES)
    turn.append(Pose2(0.0, 0.0, 0.5 * math.pi), VARIANCES)
    for root in (0, 1):  # along the axes of the earlier keyframe
        assert turn.uncertainty(root)[1 - root] == pytest.approx(np.diag(VARIANCES))


def test_a_loop_lowers_the_covariance_of_the_poses_it_connects():
    graph = ring(6, loops=1)
    earlier, later = graph.loops[0][:2]
    with_loop = np.trace(graph.uncertainty(later)[earlier][:2, :2])
    alone = np.trace(ring(6, loops=0).uncertainty(later)[earlier][:2, :2])
    assert with_loop == pytest.approx(2e-3, rel=1e-6)
    assert alone > 5.0 * with_loop
    graph.loops *= 50  # found again and again
    again = np.trace(graph.uncertainty(later)[earlier][:2, :2])
    assert again == pytest.approx(with_loop, rel=1e-6)


LIDAR = laser(n_beams=361)


def local_map():
    poses = [Pose2(0.3 * k, 0.1 * k, 0.1 * k) for k in range(4)]
    return LocalMap([keyframe(scan_at(p, LIDAR), IDENTITY) for p in poses], poses)


@pytest.mark.parametrize(("half", "rotation"), [(1.0, 0.3), (3.5, 3.0)])
def test_a_scan_is_found_in_a_wide_window(half, rotation):
    true = Pose2(0.9, -0.3, 0.4)
    scan = scan_at(true, LIDAR)
    key, place = keyframe(scan, IDENTITY), local_map()
    found = place.search(key.ends, Window(Pose2(0.4, 0.2, 0.2), half, rotation), 0.5)
    assert math.hypot(found.pose.x - true.x, found.pose.y - true.y) < 0.15
    points, frame = read_end_points(scan, IDENTITY)
    pose = place.fit(points, found.pose @ frame).pose
    assert pose == pytest.approx(true, abs=0.02)
    assert place.match_score(key.ends, pose) > 0.9


def test_free_space_conflicts_lower_the_score():
    place, true = local_map(), Pose2(0.6, 0.2, 0.0)
    ends = keyframe(scan_at(true, LIDAR), IDENTITY).ends
    right = place.match_score(ends, true)
    assert right > 0.9
    assert place.match_score(0.6 * ends, true) < 0.0  # walls in front of walls
    assert place.match_score(1.5 * ends, true) < 0.3  # hidden behind walls: neither


def test_a_wall_that_one_scan_has_is_no_conflict_with_another():
    near, far = (Scan(0.0, np.full(61, r, np.float32), laser(61)) for r in (4.0, 8.0))
    keys = [keyframe(scan, IDENTITY) for scan in (near, far)]
    assert LocalMap(keys, [IDENTITY] * 2).match_score(keys[0].ends, IDENTITY) == 1.0
    assert LocalMap(keys[1:], [IDENTITY]).match_score(keys[0].ends, IDENTITY) == -1.0


@pytest.mark.parametrize("step", [0.1, -0.1])
def test_inliers_and_conflicts_of_a_scan_by_hand(step):
    """Seven beams to one side: a wall 4 m off, then one 2 m off, no return, and nothing known."""
    ranges = np.array([4.0, 4.0, 4.0, 2.0, math.inf, math.nan])
    fan = 0.0, step, 10.0  # the seventh beam is missing
    cases = [  # beam, range [m], inlier, conflict; a tenth of the range is allowed, too
        (1, 4.0 + 0.3 + visibility.VISIBILITY_TOLERANCE, True, False),
        (1, 4.0 - 0.3 - visibility.VISIBILITY_TOLERANCE, True, False),
        (1, 4.0 - 0.4 - visibility.VISIBILITY_TOLERANCE, False, True),
        (1, 4.0 + 0.6 + visibility.VISIBILITY_TOLERANCE, False, False),  # hidden
        (2, 3.0, True, False),  # between the two walls
        (2, 1.0, False, True),
        (3, 2.0, True, False),
        (4, 3.0, True, False),  # between the near wall and no return
        (4, 12.0, False, False),  # beyond the range of the laser
        (5, 8.0, False, True),  # all that is known there is no return
        (6, 1.0, False, False),  # the beam that is missing
        (20, 4.0, False, False),  # outside of the fan
        (-20, 4.0, False, False),
    ]
    at = [(r * math.cos(k * step), r * math.sin(k * step)) for k, r, *_ in cases]
    seen = np.zeros(len(cases), np.uint8)
    visibility.check_visibility(np.array(at).T.copy(), IDENTITY, ranges, fan, seen)
    assert (seen & visibility.INLIER > 0).tolist() == [case[2] for case in cases]
    assert (seen & visibility.CONFLICT > 0).tolist() == [case[3] for case in cases]


def test_a_wall_is_in_the_cell_of_its_end_point_and_less_likely_next_to_it():
    key = keyframe(scan_at(IDENTITY, laser(61)), IDENTITY)
    likelihood, *corner, cell, _, _, _ = LocalMap([key], [IDENTITY])._field
    walls, adjacent = np.argwhere(likelihood == 1.0), np.float32(matching.ADJACENT_CELL_LIKELIHOOD)
    middles = corner + cell * walls[:, ::-1]
    assert np.abs(key.ends.T[:, None] - middles).max(axis=2).min(axis=1).max() < 0.501 * cell
    for iy, ix in walls.tolist():
        assert (likelihood[iy - 1 : iy + 2, ix - 1 : ix + 2] >= adjacent).all()
    off = np.abs(np.argwhere(likelihood > 0.0)[:, None] - walls).max(axis=2).min(axis=1)
    assert off.max() == 1
    assert set(np.unique(likelihood).tolist()) == {0.0, float(adjacent), 1.0}


def test_a_corridor_is_observed_across_only():
    log = drive(n=1)
    points, _ = read_end_points(next(iter(log)), IDENTITY)
    spread = np.array(((0.25, 0.0), (0.0, 0.001)))
    across = matching.observable_part(points, 0.0, spread)
    assert across @ np.array((1.0, 0.0)) == pytest.approx([0.0, 0.0], abs=1e-9)
    assert across @ np.array((0.0, 1.0)) == pytest.approx([0.0, 1.0], abs=0.02)


def test_the_information_is_positive_with_two_oblique_degenerate_directions():
    """A corridor oblique to the direction in which positions match equally well."""
    axes = [np.array((math.cos(a), math.sin(a))) for a in (0.0, 0.6)]
    across, beside = (np.eye(2) - np.outer(axis, axis) for axis in axes)
    match = Match(IDENTITY, information=np.diag((1e6, 1e4, 1e7)))
    assert np.linalg.eigvalsh(matching.loop_information(match, across @ beside))[0] > 0.0
