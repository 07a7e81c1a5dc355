"""tsd: ray cast, hypotheses, ICP and alignment to the field, against twins by hand."""

import math

import numpy as np
import pytest

from slams.geometry import STUDENT_DOF
from slams.types import IDENTITY, Pose2
from tests.rooms import NOTHING, error, laser, scan_at
from tests.tsd import naive as naive_tsd
from tests.tsd.cases import BOX, default, scanned
from tsd.icp_kernels import IcpRule, find_pair, sum_pairs
from tsd.map_kernels import LIKELIHOOD_STRIDE, N_LAYERS, TSD_TILE_SIDE, Field, layer_of, read_field
from tsd.match_kernels import MIN_FIELD_GRADIENT, MatchRule, accumulate, align
from tsd.model_kernels import Fan, Model, cast_rays
from tsd.ransac_kernels import CONFLICT_PENALTY, PairRule, score_pose, try_pairs
from tsd.registration import COARSE_STEP_TOLERANCE, MIN_THINNED_ELEMENTS, STEP_TOLERANCE


def test_pose_score_equals_the_naive_twin_and_stops_when_it_cannot_win():
    slam, elements = scanned()
    kernel, rule, pose = slam._map.kernel, PairRule(0.6, 0.8, 0.15), np.array(slam._estimator.pose)
    for shift in ((0.0, 0.0, 0.0), (0.07, -0.04, 0.02), (0.5, 0.6, 0.4)):
        at = pose + shift
        twin = naive_tsd.pose_score(kernel, elements, at, 0.15, CONFLICT_PENALTY)
        score = score_pose(kernel, elements, len(elements), at, rule, -np.inf)
        assert score == pytest.approx(twin, rel=1e-4, abs=1e-3)
    best = naive_tsd.pose_score(kernel, elements, pose, 0.15, CONFLICT_PENALTY)
    assert best > 0.7 * len(elements)
    wrong = pose + np.array([0.5, 0.6, 0.4])
    assert score_pose(kernel, elements, len(elements), wrong, rule, best) <= best
    alone = [score_pose(kernel, one[None], 1, pose, rule, -np.inf) for one in elements]
    rising = elements[np.argsort(alone)]  # the last ones can still win
    found = score_pose(kernel, rising, len(rising), pose, rule, sum(alone) - 0.01)
    assert found == pytest.approx(sum(alone))


def test_the_best_pair_equals_the_naive_twin_within_the_limits():
    slam, elements = scanned()
    elements = np.ascontiguousarray(elements[::9])
    kernel, pose = slam._map.kernel, slam._estimator.pose
    lines = slam._registration.cast(pose, slam._scan.laser).points
    start, rule = np.array(pose @ Pose2(0.2, 0.1, 0.2)), PairRule(0.5, math.cos(0.4), 0.15)
    trials, best = np.flatnonzero(lines[:, 4])[::3], np.zeros((2, 4))
    try_pairs(kernel, lines, trials, elements, len(elements), start, rule, best)
    scores = [naive_tsd.pose_score(kernel, elements, start, 0.15, CONFLICT_PENALTY)]
    for m in trials:
        for element in elements:
            found = naive_tsd.pair_pose(lines[m], element)
            distance, turn = error(start, found)
            if distance <= 0.5 and turn <= 0.4:
                scores.append(naive_tsd.pose_score(kernel, elements, found, 0.15, CONFLICT_PENALTY))
    assert best[0, 3] == pytest.approx(max(scores), rel=1e-3, abs=1e-2)
    assert best[0, 3] > 0.7 * len(elements) > scores[0]
    distance, turn = error(pose, best[0, :3])
    assert distance < 0.1 and turn < 0.05
    try_pairs(kernel, lines, trials[:0], elements, len(elements), start, rule, best)
    assert best[0, :3] == pytest.approx(start)  # no pair: the start


def test_alignment_equals_gauss_newton_by_hand():
    slam, elements = scanned()
    rule = MatchRule(1, 1e-4, 1e-5, 0.03, 0.01)
    prior = np.diag([100.0, 200.0, 300.0]) + 20.0
    start = np.array(slam._estimator.pose) + np.array([0.02, -0.01, 0.01])
    found, work = start.copy(), np.zeros((5, 3))
    known = start + np.array([0.01, 0.02, -0.01])
    align(slam._map.kernel, elements, len(elements), known, prior, rule, found, work)
    H, b = np.zeros((3, 3)), np.zeros(3)
    for x, y, nx, ny, information, *_ in elements:
        p = Pose2(*start).transform(np.array([[x, y]]))[0]
        n = Pose2(0.0, 0.0, start[2]).transform(np.array([[nx, ny]]))[0]
        v, *gradient = read_field(slam._map.kernel, layer_of(*n), *p)
        if math.isnan(v):
            continue
        if np.hypot(*gradient) > MIN_FIELD_GRADIENT:
            n = np.array(gradient) / np.hypot(*gradient)
        lever = p - start[:2]
        J = np.array([n[0], n[1], n[1] * lever[0] - n[0] * lever[1]])
        w = 1.0 / (1.0 / information + 0.01**2) / (1.0 + (v / 0.09) ** 2) ** 2
        H, b = H + w * np.outer(J, J), b - w * J * v
    prior = prior * (STUDENT_DOF + 3.0) / (STUDENT_DOF + (known - start) @ prior @ (known - start))
    expected = np.linalg.solve(H + prior, b + prior @ (known - start))
    assert found - start == pytest.approx(expected, rel=1e-9)
    assert work[:3] == pytest.approx(H)


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (0.3, 0.2, 1.0), (-0.4, 0.1, -2.5)])
def test_the_model_scan_shows_the_walls(pose):
    slam, lidar = default(), laser(721)
    slam.update(scan_at((0.0, 0.0, 0.0), lidar, BOX))
    for turn in np.linspace(0.5, 6.0, 12):  # all walls are in the map
        slam.insert_at(scan_at((0.0, 0.0, turn), lidar, BOX), Pose2(0.0, 0.0, turn))
    model = slam._registration.cast(Pose2(*pose), slam._scan.laser)
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


def icp_by_hand(model, elements, pose, gate, rule):
    """Pairs and normal equations of point to line, the plain way."""
    H, b, pairs = np.zeros((3, 3)), np.zeros(3), 0
    hit = model.points[:, 4] > 0.0
    for x, y, nx, ny, information, *_ in elements:
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


@pytest.mark.parametrize("stride", [1, 3])
def test_icp_sums_the_nearest_pairs_point_to_line(stride):
    slam, elements = scanned()
    pose = np.array(slam._estimator.pose) + np.array([0.02, -0.01, 0.01])
    model = slam._registration.cast(Pose2(*pose), slam._scan.laser)
    rule = IcpRule(1, 1e-4, 1e-5, 0.1, 0.05, model.fan.rays, 0.01, stride)
    work = np.zeros((4, 3))
    pairs, _ = sum_pairs(model, elements, len(elements), pose, rule, 0.1, work)
    count, H, b = icp_by_hand(model, elements[stride // 2 :: stride], pose, 0.1, rule)
    assert pairs == stride * count > 0.8 * len(elements)
    assert work[:3] == pytest.approx(stride * H) and work[3] == pytest.approx(stride * b)


def test_three_far_hits_correct_an_error_along_a_corridor():
    """All other elements match at every position along the corridor, so the residual is small."""
    slam, lidar = default(), laser(181)
    hall = np.array([(-5.0, -0.4, 12.0, -0.4), (-5.0, 0.4, 12.0, 0.4), (12.0, -0.4, 12.0, 0.4)])
    for x in (-0.1, 0.0, 0.1, 0.0):
        slam.insert_at(scan_at((x, 0.0, 0.0), lidar, hall), Pose2(x, 0.0, 0.0))
    view, found, work = slam._scan, np.array((0.1, 0.0, 0.0)), np.zeros((5, 3))
    assert np.sum(np.abs(view.elements[: view.count, 2]) > 0.7) == 3
    prior, rule = np.eye(3) / 0.01**2, MatchRule(15, 1e-4, 1e-5, 0.03, 0.01)
    align(slam._map.kernel, view.elements, view.count, found.copy(), prior, rule, found, work)
    assert np.abs(found[0]) < 0.01


def test_icp_comes_back_from_farther_than_the_field_reaches():
    off, ends = Pose2(0.3, -0.28, 0.1), []  # the field reaches 0.15 m
    for gate in (0.4, 0.02):
        slam = default(refine=False, widest_gate=gate)
        slam.update(scan_at((0.0, 0.0, 0.0)))
        ends.append(error(IDENTITY, slam._registration.icp(slam._scan, off, NOTHING).pose))
    assert ends[0][0] < 0.005 and ends[0][1] < 0.003 and ends[1][0] > 0.05


CELL, TILES = 0.05, 8


def field_of(planes):
    """A field around (0, 0) with a linear distance in some layers: layer to f(x, y)."""
    side = TSD_TILE_SIDE
    n = TILES * side
    centers = -0.5 * n * CELL + CELL * (np.arange(n) + 0.5)
    x, y = np.meshgrid(centers, centers)
    slots = np.zeros((TILES, TILES, N_LAYERS), np.int32)
    tiles = [np.full((side, side), np.nan)]
    for layer, plane in planes.items():
        values = plane(x, y)
        for ty in range(TILES):
            for tx in range(TILES):
                slots[ty, tx, layer] = len(tiles)
                tiles.append(values[ty * side : (ty + 1) * side, tx * side : (tx + 1) * side])
    tsd = np.array(tiles, np.float32)
    corner, seen = np.full(2, -0.5 * n * CELL), np.zeros((n, n), np.uint8)
    walls = np.zeros((n // LIKELIHOOD_STRIDE, n // LIKELIHOOD_STRIDE), np.float32)
    return Field(slots, tsd, np.ones_like(tsd), corner, CELL, np.array([len(tsd)]), seen, walls)


@pytest.mark.parametrize(("right", "top"), [(1.0, 1.002), (1.002, 1.0)])
def test_of_two_surfaces_in_one_step_a_ray_hits_the_nearer_one(right, top):
    field = field_of({2: lambda x, y: right - x, 3: lambda x, y: top - y})
    model = Model(np.zeros((1, 5)), Fan(1, 0.25 * math.pi, 0.1, 5.0, 0), 0.0, 0.0, 0.0)
    assert cast_rays(field, model) == 1
    x, y, nx, ny, distance = model.points[0]
    nearer = (-1.0, 0.0) if right < top else (0.0, -1.0)
    assert (nx, ny) == pytest.approx(nearer, abs=1e-4)
    assert distance == pytest.approx(math.sqrt(2.0), abs=2e-3)
    assert (x, y) == pytest.approx((1.0, 1.0), abs=2e-3)


@pytest.mark.parametrize("refine", [True, False])
def test_only_an_icp_that_nothing_follows_pairs_all_elements(refine, monkeypatch):
    rules = []
    monkeypatch.setattr("tsd.registration.icp", lambda *args: rules.append(args[5]) or (0, 0, 0))
    slam, elements = scanned(refine=refine)
    slam._registration.icp(slam._scan, IDENTITY, NOTHING)
    assert len(elements) >= 2 * MIN_THINNED_ELEMENTS
    assert rules[-1].stride == (len(elements) // MIN_THINNED_ELEMENTS if refine else 1)
    assert rules[-1][1:3] == (COARSE_STEP_TOLERANCE if refine else STEP_TOLERANCE)


def test_an_alignment_does_not_end_before_its_robust_scale_does():
    slam, elements = scanned()
    free, anything = np.zeros((3, 3)), MatchRule(15, 1.0, 1.0, 0.03, 0.01)
    found, work = np.array(slam._estimator.pose), np.zeros((5, 3))
    known = found.copy()
    *_, used = align(slam._map.kernel, elements, len(elements), known, free, anything, found, work)
    assert used == 2  # at three times the scale, and at the last


def test_pairs_are_found_across_the_seam_of_a_full_circle():
    slam, lidar = default(), laser(720, fov=2.0 * math.pi * 719 / 720)
    slam.update(scan_at((0.0, 0.0, 0.0), lidar, BOX))
    model = slam._registration.cast(IDENTITY, slam._scan.laser)
    assert model.fan.per_circle == model.fan.rays == 90
    for y in (0.02, -0.02):  # astern, on either side of the seam
        found = find_pair(model, -3.0, y, 1.0, 0.0, 2)
        assert np.hypot(*(model.points[found, :2] - (-3.0, y))) < 0.51 * 3.0 * model.fan.gap
    assert find_pair(model, -3.0, 0.0, -1.0, 0.0, 2) == -1  # the back of the wall


def test_an_element_with_a_normal_unlike_the_gradient_is_left_out():
    slam, elements = scanned()
    pose, rule = np.array(slam._estimator.pose), MatchRule(1, 1e-4, 1e-5, 0.03, 0.01)
    one = elements[len(elements) // 2 :][:1].copy()
    kernel, along = slam._map.kernel, one[0, 2:4].copy()
    across, H = np.array((-along[1], along[0])), np.zeros((3, 3))
    for degrees, known, counts in ((0, 1, True), (20, 1, True), (40, 1, False), (40, 0, True)):
        turn = math.radians(degrees)
        one[0, 2:4], one[0, 7] = math.cos(turn) * along + math.sin(turn) * across, known
        known, close, _ = accumulate(kernel, one, 1, pose, rule, 0.03, H, np.zeros(3))
        assert known == 1.0 and close > 0.9
        assert (np.trace(H[:2, :2]) > 0.0) == counts
