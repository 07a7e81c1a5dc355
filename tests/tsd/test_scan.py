"""tsd: from ranges to surface elements."""

import dataclasses
import math

import numpy as np
import pytest

from slams.types import IDENTITY, Pose2
from tests.rooms import ROOM, box, cast, laser, scan_at
from tests.tsd import naive as naive_tsd
from tests.tsd.cases import RULE, default, field_of, read, sums_of
from tsd.map_kernels import PushRule, list_rows, place_lines
from tsd.scan_kernels import Beams, find_runs, fit_best_line, fit_line, fit_surfaces


def test_line_fit_is_total_least_squares():
    rng = np.random.default_rng(0)
    for turn in np.linspace(0.0, 3.0, 7):
        t = np.linspace(-0.2, 0.3, 20)
        points = np.stack([t * math.cos(turn) + 2.0, t * math.sin(turn) - 1.0], axis=1)
        points += rng.normal(0.0, 0.005, points.shape)
        x, y, nx, ny, variance = fit_line(sums_of(points), 0, 20)
        center, normal = naive_tsd.line_of(points)
        assert (x, y) == pytest.approx(tuple(center))
        assert abs(nx * normal[0] + ny * normal[1]) == pytest.approx(1.0, abs=1e-6)
        offsets = (points - center) @ normal
        assert variance == pytest.approx((offsets**2).sum() / 18, rel=1e-6)


def test_a_window_beside_is_taken_only_if_it_is_twice_as_smooth():
    rng, reach, k, beside = np.random.default_rng(0), 4, 10, []
    for _ in range(200):
        points = np.stack([0.05 * np.arange(21), rng.normal(0.0, 0.01, 21)], axis=1)
        sums = sums_of(points)
        around = fit_line(sums, k - reach, k + reach + 1)
        before, after = fit_line(sums, k - 2 * reach, k + 1), fit_line(sums, k, k + 2 * reach + 1)
        best, limit = around, 0.5 * around[4]
        for side in (before, after):
            if side[4] < limit:
                best, limit = side, side[4]
        found = fit_best_line(sums, k, reach, 0, 21, 0.0)
        assert found == best
        assert fit_best_line(sums, k, reach, 0, 21, 1.001 * around[4]) == around
        beside.append(best is not around)
    assert 5 < sum(beside) < 100


@pytest.mark.parametrize(("k", "pair"), [(1, (0, 2)), (6, (6, 8))])
def test_two_hits_at_the_end_of_a_surface_are_no_window_of_their_own(k, pair):
    rng = np.random.default_rng(0)
    sums = sums_of(np.stack([0.05 * np.arange(8), rng.normal(0.0, 0.01, 8)], axis=1))
    assert fit_best_line(sums, k, 4, 0, 8, 0.0) != fit_line(sums, *pair)


def test_surface_elements_stand_for_their_beams():
    lidar = laser(1081)
    room = np.array(box(-2.0, -3.0, 4.0, 2.5))
    beams, points, count, sums = read(cast(room, (0.0, 0.0, 0.0), lidar), lidar)
    firsts, out = np.zeros(1082), np.zeros((1081, 8))
    points[3] = 4.0  # weight of a beam: half of the noise
    find_runs(points, count, beams, RULE, firsts)
    n = fit_surfaces(points, count, sums, firsts, beams, RULE, 0.05, out)
    x, y, nx, ny, information, index, beams_each, known = out[:n].T
    off = np.min(np.abs([x + 2.0, x - 4.0, y + 3.0, y - 2.5]), axis=0)
    assert off.max() < 0.01 and np.mean(off < 1e-3) > 0.95  # corners: within the noise
    assert (nx * x + ny * y < 0.0).all()  # towards the laser
    assert np.abs(np.hypot(nx, ny) - 1.0).max() < 1e-9
    assert (np.diff(index) > 0).all()
    assert index[0] == int(0.05 / (np.hypot(*points[:2, 0]) * lidar.angle_increment)) // 2
    wall = (np.abs(x - 4.0) < 1e-3) & (np.abs(y) < 2.0)  # at 4 m: a beam every 1.7 cm
    step = np.hypot(x, y) * lidar.angle_increment
    stride = np.maximum((0.05 / step).astype(int), 1)
    cosine = 4.0 / np.hypot(x, y)
    blur = 0.2 * step * np.abs(y) / np.hypot(x, y)  # along the wall, which the beam meets obliquely
    expected = stride / ((0.5 * 0.01 * cosine) ** 2 + blur**2)
    assert information[wall] == pytest.approx(expected[wall], rel=0.05)
    assert (beams_each[wall] == stride[wall]).mean() > 0.9 and beams_each.sum() <= count
    assert known.all()
    for steps, known in ((1.5, False), (2.5, True)):  # of the beams at 4.4 m
        rule = RULE._replace(window=steps * 4.4 * lidar.angle_increment)
        n = fit_surfaces(points, count, sums, firsts, beams, rule, 0.05, out)
        near = np.abs(np.hypot(*points[:2, out[:n, 5].astype(int)]) - 4.4) < 0.05
        assert near.any() and (out[:n, 7][near] == known).all()
    dense = fit_surfaces(points, count, sums, firsts, beams, RULE, 0.0, out)
    assert dense > 0.97 * count


def test_an_element_of_a_rough_surface_is_at_its_hit():
    beams, points, count, sums = read(cast(ROOM, (0.0, 0.0, 0.0), laser(1081)), laser(1081))
    rule, firsts, out = RULE._replace(max_variance=-1.0), np.zeros(1082), np.zeros((1081, 8))
    find_runs(points, count, beams, rule, firsts)
    n = fit_surfaces(points, count, sums, firsts, beams, rule, 0.05, out)
    assert np.array_equal(out[:n, :2], points[:2, out[:n, 5].astype(int)].T)


def test_dust_neither_thins_the_walls_nor_multiplies_the_elements():
    clean, dusty, rng = default(), default(), np.random.default_rng(5)
    scan = scan_at((0.3, -0.2, 0.5), laser(1081), noise=0.01, rng=rng)
    struck = rng.random(1081) < 0.3
    short = np.where(struck, rng.uniform(0.1, scan.ranges), scan.ranges).astype(np.float32)
    few = clean._scan.read(scan, IDENTITY).count
    assert dusty._scan.read(dataclasses.replace(scan, ranges=short), IDENTITY).count < 1.5 * few


BEAMS = Beams(0.0, 0.0, 0.01)


def firsts_of(points, n, beams):
    firsts = np.zeros(n + 1)
    find_runs(points, n, beams, RULE, firsts)
    return firsts[:n].tolist()


def firsts(points):
    numbered = [(x, y, k) for k, (x, y) in enumerate(points)]
    return firsts_of(np.ascontiguousarray(np.transpose(numbered)), len(points), BEAMS)


def test_a_wall_at_grazing_incidence_reaches_from_its_first_hit_to_its_last():
    wall, before, behind = [(5.0, 1.0), (7.0, 1.0), (11.0, 1.0)], (3.0, 2.0), (4.0, 9.0)
    assert firsts([before, *wall]) == [0, 1, 1, 1]
    assert firsts([*wall, behind]) == [0, 0, 0, 3]
    assert firsts([(5.0, 1.0), (7.0, 1.5), (11.0, 1.0)]) == [0, 1, 2]  # not in line: no surface


def test_an_isolated_hit_between_distant_beams_has_no_normal():
    for n_beams, alone in ((41, True), (1081, False)):
        lidar = laser(n_beams)
        ranges = np.full(n_beams, np.inf, np.float32)
        ranges[n_beams // 2] = 6.0
        beams, points, count, sums = read(ranges, lidar)
        rule, out, firsts = RULE._replace(max_gap=0.5), np.zeros((count, 8)), np.zeros(count + 1)
        find_runs(points, count, beams, rule, firsts)
        assert fit_surfaces(points, count, sums, firsts, beams, rule, 0.05, out) == (not alone)
        rule = rule._replace(keep_isolated=True)
        assert fit_surfaces(points, count, sums, firsts, beams, rule, 0.0, out) == 1
        assert np.hypot(*out[0, 2:4]) == pytest.approx(0.0 if alone else 1.0)
        line = out.copy()
        lines = np.zeros((1, 7))
        place_lines(line, 1, firsts, beams, np.zeros(3), lines)
        field, rows = field_of(max_weight=100.0).kernel, np.zeros((999, 4))
        rule = PushRule(0.15, 100.0, lidar.angle_increment)
        assert not alone or list_rows(field, lines, 1, rule, rows) == 0


def test_surfaces_are_placed_in_the_map_with_the_incidence_of_their_beams():
    beams, points, count, sums = read(cast(ROOM, IDENTITY, laser(181)), laser(181))
    firsts, out, lines = np.zeros(count + 1), np.zeros((count, 8)), np.zeros((count, 7))
    find_runs(points, count, beams, RULE, firsts)
    n = fit_surfaces(points, count, sums, firsts, beams, RULE, 0.0, out)
    pose = Pose2(1.0, -2.0, 0.7)
    bounds = place_lines(out, n, firsts, beams, np.array(pose), lines)
    at, normals = out[:n, :2], out[:n, 2:4]
    to_laser = np.array((beams.mount_x, beams.mount_y)) - at
    ranges = np.hypot(*to_laser.T)
    cosines = np.maximum((to_laser * normals).sum(axis=1) / ranges, 0.1)
    placed = pose.transform(at)
    np.testing.assert_allclose(lines[:n, :2], placed)
    np.testing.assert_allclose(lines[:n, 2:4], Pose2(0.0, 0.0, 0.7).transform(normals))
    np.testing.assert_allclose(lines[:n, 4], cosines)
    np.testing.assert_allclose(lines[:n, 5], ranges * out[:n, 6])
    assert bounds == pytest.approx((*placed.min(axis=0), *placed.max(axis=0)))


def test_lines_half_a_cell_apart_make_the_field_that_every_hit_makes(monkeypatch):
    pools = []
    for lines in (0.5, 0.0):
        monkeypatch.setattr("tsd.scan.LINE_SPACING_CELLS", lines)
        slam = default()
        for k in range(3):
            slam.update(scan_at((0.0, 0.0, 0.0), laser(1081), ROOM, t=0.1 * k))
        drawing = slam._map.snapshot()
        pools.append((drawing.tsd[drawing.slots], drawing.corner))
        counts = slam._scan.lines(IDENTITY)[0].shape[0]
    (few, a), (all_hits, b) = pools
    known = np.isfinite(few) & np.isfinite(all_hits)
    assert a == b and counts > 1000
    assert known.sum() > 0.99 * np.isfinite(all_hits).sum()
    assert np.median(np.abs(few - all_hits)[known]) < 1e-4
    assert np.percentile(np.abs(few - all_hits)[known], 95) < 0.005


def test_surfaces_equal_the_naive_twin():
    lidar = laser(361)
    ranges = cast(ROOM, (0.3, -0.2, 0.5), lidar).copy()
    ranges[100:106] = np.inf
    ranges[200] = np.inf
    beams, points, n, _ = read(ranges, lidar)
    xy, beam = points[:2, :n].T, points[2, :n]
    twin = naive_tsd.runs_of(xy, np.hypot(*xy.T), beam, lidar.angle_increment, 8.0, 0.01)
    assert firsts_of(points, n, beams) == [float(first) for first, _ in twin]
    assert len({first for first, _ in twin}) > 3
