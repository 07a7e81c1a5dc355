"""Line cells: which hits enter, in which cells, and the variance of the distances."""

import math

import numpy as np
import pytest

from slams.geometry import Prior
from slams.refine import lines as lines_module
from slams.refine.line_cell_kernels import Hits, LineUpdate, add_hits, add_scan, add_to_cell
from slams.refine.line_kernels import N_CLUSTERS, Fit, View, line_equations
from slams.refine.lines import MAX_BEAM_STRIDE, MIN_FIRST_CONFIDENCE, LineMap, Match
from slams.refine.params import RefineParams
from slams.scan.end_points import EndPoints
from slams.types import IDENTITY, Pose2
from tests.rooms import NOTHING, calls, laser, scan_at

LIDAR = laser(721)
SIZE, CELL = 240, 0.05
FIRST = (-6.0, -6.0)
FREE = -0.5


def blank(**changes):
    grid = np.ones((SIZE, SIZE), np.float32)
    return LineMap(RefineParams(**changes), grid, FIRST, CELL, FREE)


def seen_at(pose=IDENTITY):
    return EndPoints(RefineParams()).read(scan_at(pose, LIDAR), IDENTITY)


def mapped(times=3):
    lines, points = blank(), seen_at()
    for _ in range(times):
        lines.insert(points, IDENTITY)
    return lines, points


def hit(n=1.0, x=0.0, y=0.0, nx=0.0, ny=1.0):
    return Hits(n, x, y, nx, ny)


def update_of(reach=1, side=3, cap=200.0, number=1):
    return LineUpdate(reach, side, cap, number, MIN_FIRST_CONFIDENCE)


def row_of(lines, ix, iy):
    return lines.cells.lines[lines.cells.slot[iy, ix]]


def test_a_hit_whose_wall_looks_another_way_is_not_used():
    lines, points = mapped()
    assert lines.fit(points, IDENTITY, NOTHING).inlier_ratio > 0.8
    normals = points.normals[:2].copy()
    points.normals[0], points.normals[1] = -normals[1], normals[0]  # a quarter turn
    none = lines.fit(points, IDENTITY, NOTHING)
    assert none.inlier_ratio < 0.05
    points.normals[:2] = 0.0  # one that has no normal is used
    assert lines.fit(points, IDENTITY, NOTHING).inlier_ratio > 0.8


def test_a_prior_counts_by_the_variance_of_a_beam():
    lines, points = mapped()
    there, held = Pose2(0.02, 0.0, 0.0), []
    for variance in (1e-8, 1e2):
        lines.variance = variance
        held.append(lines.fit(points, there, Prior(there, 1e6 * np.eye(3))).pose.x)
    assert held[0] == pytest.approx(0.0, abs=2e-3)
    assert held[1] == pytest.approx(0.02, abs=1e-4)


@pytest.mark.parametrize(("interval", "confidence"), [(0.025, 0.1), (0.6, 0.3), (5.0, 0.5)])
def test_one_scan_alone_counts_where_the_next_is_long_after(interval, confidence):
    """A person's leg is gone a second later."""
    points, confidences = EndPoints(RefineParams()), []
    for t in (0.0, interval, 2.0 * interval):
        points.read(scan_at(IDENTITY, LIDAR, t=t), IDENTITY)
    for times in (1, 2):
        lines = blank()
        for _ in range(times):
            lines.insert(points, IDENTITY)
        sums, found = lines.cells.sums, lines.cells.lines[:, 3]
        confidences.append(found[found > 0.0] / (sums[:, 0] / (sums[:, 0] + 2.0))[found > 0.0])
    assert np.median(confidences[0]) == pytest.approx(confidence, rel=0.01)
    assert np.median(confidences[1]) == pytest.approx(0.5, rel=0.01)


def test_information_is_in_units_of_the_variance_that_is_learned():
    lines, points = mapped()
    held = Prior(Pose2(0.01, 0.01, 0.0), 1e12 * np.eye(3))
    match = lines.fit(points, held.pose, held)
    square, effect = match.mean_square, match.design_effect
    assert effect > 1.0 and match.information == pytest.approx(lines._H / (square * effect))
    for wheels, expected in ((True, square), (False, square * effect)):
        lines.learn_variance(match, points, wheels)
        assert lines.variance == pytest.approx(expected)
    lines.learn_variance(match._replace(mean_square=0.0), points, wheels=True)
    assert lines.variance == points.noise**2


def test_a_close_start_uses_all_beams_at_once(monkeypatch):
    lines, points = mapped()
    made = calls(monkeypatch, lines_module, "fit")
    for close in (True, False):
        lines.fit(points, IDENTITY, Prior(IDENTITY, 1e12 * np.eye(3)), close)
    assert [Fit(*settings).stride for *_, settings, _ in made] == [1, MAX_BEAM_STRIDE]


def test_a_conflict_is_an_end_point_in_a_free_cell_without_a_line():
    lines, points = blank(), seen_at()
    for level, score in ((-0.4, 0.0), (-0.6, -1.0)):
        lines.cells.grid[:] = level
        assert lines.evaluate(points, IDENTITY) == (0.0, -score)
    lines, points = mapped()
    lines.cells.grid[:] = -0.6
    inliers, conflicts = lines.evaluate(points, IDENTITY)
    aside = Pose2(0.03, 0.0, 0.0)
    equal, _ = lines.evaluate(points, aside)
    points.points[3] = 4.0  # half of the noise
    assert lines.evaluate(points, aside)[0] < 0.9 * equal
    assert inliers > 0.9 and conflicts < 0.05


def test_a_line_of_one_scan_alone_has_low_confidence():
    lines, confidences = blank(), []
    for number in (1, 1, 2, 3, 4):
        add_to_cell(lines.cells, 120, 120, hit(), update_of(number=number))
        confidences.append(float(row_of(lines, 120, 120)[3]))
    shares = [w / (w + 2.0) for w in (1.0, 2.0, 3.0, 4.0, 5.0)]
    expected = np.multiply(shares, [0.1, 0.1, 1.0 / 2.0, 2.0 / 3.0, 3.0 / 4.0])
    assert confidences == pytest.approx(expected, rel=1e-5)


def test_beyond_its_cap_a_line_follows_slowly():
    lines, update = blank(), update_of(cap=10.0)
    for n in (12.0, 1e6):  # more hits than the cap
        add_to_cell(lines.cells, 119, 119, hit(n), update)
        assert np.isfinite(row_of(lines, 119, 119)).all()
    for y in (0.0, 0.02):
        add_to_cell(lines.cells, 120, 120, hit(8.0, 0.0, y), update)
    assert lines.cells.sums[lines.cells.slot[120, 120], 0] == pytest.approx(10.0)
    assert row_of(lines, 120, 120)[2] == pytest.approx(0.8 * 0.02)


def test_faces_of_a_thin_wall_and_walls_of_a_corner_have_a_layer_each():
    lines, update = blank(), update_of()
    for nx, ny in ((0.0, 1.0), (0.0, -1.0)):
        add_to_cell(lines.cells, 120, 120, hit(1.0, 0.0, 0.0, nx, ny), update)
    both = row_of(lines, 120, 120)
    assert both[:2] == pytest.approx([0.0, 1.0]) and both[4:6] == pytest.approx([0.0, -1.0])


def touched(lines):
    iy, ix = np.nonzero(lines.cells.slot)
    return sorted(zip((ix - 120).tolist(), (iy - 120).tolist(), strict=True))


@pytest.mark.parametrize(("gap", "side"), [(0.04, 0), (0.06, 1), (0.16, 2), (9.0, 3)])
def test_a_hit_reaches_across_its_wall_and_half_way_to_the_next_along_it(gap, side):
    lines = blank()
    add_hits(lines.cells, hit(), gap, update_of())
    assert touched(lines) == sorted((i, j) for i in range(-side, side + 1) for j in (-1, 0, 1))
    lines = blank()
    add_hits(lines.cells, hit(1.0, 0.0, 0.0, 1.0, 0.0), gap, update_of(reach=2))
    assert touched(lines) == sorted((i, j) for i in range(-2, 3) for j in range(-side, side + 1))


@pytest.mark.parametrize(
    ("coarse", "fits", "found"),
    [
        (0.02, {0.0: 0.0}, [0.0]),  # near the start: one fit, from there
        (0.04, {0.04: 0.03, 0.0: 0.0}, [0.0, 0.03]),  # half a cell off: one from the start, too
        (0.04, {0.04: 0.03, 0.0: 0.025}, [0.03]),  # which is the same
    ],
)
def test_lines_are_fitted_from_the_start_and_the_coarse_match(coarse, fits, found, monkeypatch):
    lines, points = mapped()

    def fit(points, start, prior, close=False):
        assert close == (len(fits) == 1)
        return Match(Pose2(fits[round(start.x, 3)], 0.0, 0.0))

    monkeypatch.setattr(lines, "fit", fit)
    tried = lines.refine(points, IDENTITY, Pose2(coarse, 0.0, 0.0), NOTHING)
    assert [one.pose.x for one in tried] == found


def wall(x=1.0, n=20):
    """Hits (2, n) of a wall that looks to -x, and their normals."""
    points = np.stack([np.full(n, x), np.linspace(-0.3, 0.3, n)])
    return points, np.stack([np.full(n, -1.0), np.zeros(n), np.zeros(n)])


def one_wall():
    lines = blank()
    add_scan(lines.cells, *wall(), 20, IDENTITY, update_of(1, 0, 1e6))
    return lines.cells


def test_a_wall_near_its_cells_border_is_not_pushed_away():
    lines, border = blank(), 1.0 + 0.5 * CELL
    lines.cells.grid[:] = -1.0
    lines.cells.grid[120, 141] = 1.0  # the wall's cell; noise puts a third of the hits before it
    hits, normals = wall(n=30)
    hits[0], hits[1] = border + np.array([-0.004, 0.004, 0.012] * 10), 0.0
    add_scan(lines.cells, hits, normals, 30, IDENTITY, update_of(2, 0, 1e6))
    assert -row_of(lines, 141, 120)[2] == pytest.approx(border + 0.004, abs=5e-4)


def test_a_wall_is_not_met_from_behind():
    cells, H, b = one_wall(), np.zeros((3, 3)), np.zeros(3)
    for sensor, met in ((0.0, True), (2.0, False)):
        pose = Pose2(sensor, 0.0, 0.0)
        ends = np.concatenate([wall()[0] - [[sensor], [0.0]], np.ones((2, 20))])
        view = View(ends, np.zeros_like(ends), 20, IDENTITY)
        total, _, near, _ = line_equations(cells, view, 1, pose, 400.0, H, b)
        assert (total > 0.0) == (near > 0.0) == met


def test_a_full_pool_refuses_more_cells_without_harm():
    cells = one_wall()
    cells = cells._replace(lines=cells.lines[: cells.used[0] + 2].copy())
    before = int(cells.used[0])
    add_scan(cells, *wall(-1.0), 20, Pose2(0.0, 0.0, math.pi), update_of(1, 0, 1e6, 2))
    add_scan(cells, *wall(2.0), 20, IDENTITY, update_of(1, 0, 1e6, 2))
    assert cells.used[0] == before + 1


def sums_by_hand(lines, points, pose, soft, stride):
    """H, b of distances to the nearer of the lines that face the laser, and the design effect."""
    H, b, terms = np.zeros((3, 3)), np.zeros(3), np.zeros(points.n)
    for k in range(0, points.n, stride):
        end = points.points[:2, k]
        at = pose.transform(end[None])[0]
        cell = np.floor((at - FIRST) / CELL + 0.5).astype(int)
        rows = row_of(lines, *cell).astype(float).reshape(2, 4)
        rows = [row for row in rows if row[3] > 0.0 and row[:2] @ pose[:2] > row[2]]
        if rows:
            *n, d, confidence = min(rows, key=lambda row: abs(row[:2] @ at - row[2]))
            e, q = n @ at - d, at - pose[:2]
            J = np.array([*n, n[1] * q[0] - n[0] * q[1]])
            p = points.points[3, k]
            w = p * confidence / (1.0 + soft * p * e * e)
            H, b, terms[k] = H + w * np.outer(J, J), b - w * e * J, w * e
    clusters = (np.arange(points.n) + stride - 1) // math.ceil(points.n / N_CLUSTERS)
    effect = (np.bincount(clusters, terms) ** 2).sum() / (terms @ terms)
    return H, b, effect - 2.0 * math.sqrt(2.0 / N_CLUSTERS)


@pytest.mark.parametrize("stride", [1, 3])
def test_normal_equations_are_those_of_the_distances_to_lines(stride):
    (lines, points), pose = mapped(), Pose2(0.03, -0.02, 0.01)
    H, b = np.zeros((3, 3)), np.zeros(3)
    points.points[3] = np.random.default_rng(0).uniform(0.2, 4.0, points.points.shape[1])
    view = View(points.points, points.normals, points.n, IDENTITY)
    *_, effect = line_equations(lines.cells, view, stride, pose, 400.0, H, b)
    expected_H, expected_b, expected = sums_by_hand(lines, points, pose, 400.0, stride)
    assert effect == pytest.approx(expected, rel=1e-3) and effect > 1.0
    assert pytest.approx(expected_H, rel=1e-4, abs=1e-6) == H
    assert b == pytest.approx(expected_b, rel=1e-4, abs=1e-4)


def test_errors_of_beams_that_are_independent_have_no_design_effect():
    (lines, points), H, b = mapped(), np.zeros((3, 3)), np.zeros(3)
    ends, normals = points.points.copy(), points.normals[:2, : points.n]
    ends[:2, : points.n] += np.random.default_rng(0).normal(0.0, 0.01, points.n) * normals
    view = View(ends, normals, points.n, IDENTITY)
    assert line_equations(lines.cells, view, 1, IDENTITY, 400.0, H, b)[-1] == 1.0


def test_along_a_slanted_wall_a_hit_reaches_along_the_wall():
    lines, c = blank(), math.sqrt(0.5)
    add_hits(lines.cells, hit(1.0, 0.0, 0.0, -c, c), 0.3, update_of(reach=0))
    assert touched(lines)[0][0] < 0 and all(abs(ix - iy) <= 1 for ix, iy in touched(lines))


def test_hits_of_a_noisy_laser_reach_as_many_cells_as_their_noise(monkeypatch):
    updates = []
    monkeypatch.setattr("slams.refine.lines.add_scan", lambda *args: updates.append(args[-1]))
    lines, points = blank(), seen_at()
    for noise in (0.01, 0.06):
        points._noise._std.value = noise
        lines.insert(points, IDENTITY)
    assert [update.reach for update in updates] == [1, 3]
    assert [update.number for update in updates] == [1, 2]


def test_what_stands_where_it_was_free_is_no_wall():
    lines = blank()
    lines.cells.grid[:] = -0.1
    lines.insert(seen_at(), IDENTITY)
    assert not lines.cells.slot.any()


def test_a_beam_counts_half_at_three_deviations_of_the_noise():
    lines, points = blank(), seen_at()
    for noise, soft in ((0.02, 0.06), (0.05, 0.15), (0.001, lines.params.softness)):
        points._noise._std.value = noise
        assert lines._softness(points) == pytest.approx(soft)
