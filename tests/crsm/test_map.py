"""Reading a scan, and the gray map: critical rays and updates against naive twins, its growth."""

import math

import numpy as np
import pytest

from crsm.map import GrayMap
from crsm.map_kernels import Grid, Update, add_free_space, add_walls, darkness, wall_segments
from crsm.params import CrsmParams
from crsm.rays_kernels import leverage
from crsm.scan import MIN_CRITICAL_RAYS, ScanReader
from slams.jit import njit
from slams.types import IDENTITY, Pose2, Scan
from tests.crsm import naive
from tests.crsm.room import LASER, drive, noisy_view, reader_of
from tests.rooms import laser, made, scan_at

RULE = Update(0.3, 100.0, 0.035, 0.6)


@njit(inner=True)
def darkness_at(grid, x, y):
    return darkness(grid, (x - grid.x0) / grid.resolution, (y - grid.y0) / grid.resolution)


def blank(n=100, cell=0.05):
    """Cells around the origin, of which one has its center there."""
    corner = -cell * (n // 2)
    arrays = np.zeros((n, n), np.float32), np.zeros((n, n), np.float32), np.zeros((n, n), np.int32)
    return Grid(*arrays, corner, corner, cell)


def wall(angle, distance, spacing=0.02, length=2.0):
    """Segments of one straight wall at a distance [m], facing the origin."""
    c, s = math.cos(angle), math.sin(angle)
    along = np.arange(-length, length, spacing)
    ends = np.empty((len(along), 5))
    ends[:, 0], ends[:, 1] = distance * c - along * s, distance * s + along * c
    ends[:, 2:] = -c, -s, 0.5 * spacing
    return ends


def test_neighbors_on_one_wall_are_one_segment():
    points, normals = np.zeros((3, 7)), np.zeros((3, 7))
    points[0] = (1.0, 1.0, 1.0, 1.0, 0.9, 0.89, 0.8)
    points[1] = (0.0, 0.01, 0.02, 0.05, 0.05, 0.05, 0.05)
    normals[0, :5], normals[1, 5] = -1.0, -1.0
    normals[2] = 0.01
    out = np.zeros((7, 5))
    assert wall_segments(points, normals, 7, 0.025, out) == 5
    expected = [
        (1.0, 0.01, -1.0, 0.0, 0.015),  # three of them, and half of a gap at each end
        (1.0, 0.05, -1.0, 0.0, 0.005),  # too far away
        (0.9, 0.05, -1.0, 0.0, 0.005),
        (0.89, 0.05, 0.0, -1.0, 0.005),  # another wall
        (0.8, 0.05, 0.0, 0.0, 0.005),  # an isolated point
    ]
    np.testing.assert_allclose(out[:5], expected, atol=1e-12)


def test_map_update_equals_the_naive_one():
    grid, laser = blank(240), Pose2(0.3, 0.1, 0.0)
    gray, weight, ends = grid.gray.copy(), grid.weight.copy(), np.zeros((800, 5))
    for mark, pose in enumerate(drive(3), 1):
        view = noisy_view(mark, pose)
        count = wall_segments(view.points, view.normals, view.n, 0.025, ends)
        assert 0 < (~ends[:count, 2:4].any(axis=1)).sum() < count < view.n
        add_walls(grid, ends, count, tuple(pose), mark, tuple(RULE))
        add_free_space(grid, ends, count, tuple(pose), tuple(laser), mark, tuple(RULE))
        frame, rules = ((grid.x0, grid.y0), grid.resolution), (laser[:2], *RULE)
        naive.insert(gray, weight, ends[:count], pose, frame, rules)
    differ = (np.abs(grid.gray - gray) > 1e-4) | (np.abs(grid.weight - weight) > 1e-4)
    assert differ.sum() <= 4  # a sample on the border of two cells
    assert (grid.gray < -0.55).sum() > 3000  # free by three scans
    assert (grid.gray > 0.5).sum() > 300


def test_the_weight_of_a_cell_is_limited():
    grid, ends = blank(), wall(0.0, 1.0)
    for mark in range(1, 30):
        add_walls(grid, ends, len(ends), IDENTITY, mark, (0.3, 7.0, 0.035, 0.6))
    assert grid.weight.max() == 7.0


def test_darkness_is_the_spline_of_the_cells_around():
    def spline(d):
        d = abs(d)
        return 0.75 - d * d if d < 0.5 else 0.5 * max(1.5 - d, 0.0) ** 2

    grid, rng = blank(), np.random.default_rng(0)
    grid.gray[:] = rng.uniform(-1.0, 1.0, grid.gray.shape)
    for u, v in rng.uniform(20.0, 40.0, (20, 2)):
        expected = sum(
            spline(u - i) * spline(v - j) * max(grid.gray[j, i], 0.0)
            for i in range(math.floor(u) - 2, math.floor(u) + 4)
            for j in range(math.floor(v) - 2, math.floor(v) + 4)
        )
        at = grid.x0 + u * grid.resolution, grid.y0 + v * grid.resolution
        assert darkness_at(grid, *at) == pytest.approx(expected, rel=1e-5)
    assert darkness_at(grid, -2.6, 0.0) == darkness_at(grid, 0.0, 99.0) == 0.0  # beyond the map


def test_a_building_that_begins_at_the_start_is_not_moved(monkeypatch):
    grid, view = GrayMap(CrsmParams(max_cells=1 << 18)), reader_of(scan_at(IDENTITY, LASER))
    before = grid.levels[0].gray
    side = 0.05 * math.isqrt(1 << 18)
    assert grid.insert(view, Pose2(0.5 * side, 0.0, 0.0))
    assert grid.levels[0].gray is before


def test_critical_rays_equal_the_naive_selection():
    view, count = noisy_view(), CrsmParams().critical_rays
    n = view.n
    xy, normal = view.points[:2, :n].T, view.normals[:2, :n].T
    assert not normal.any(axis=1).all()  # isolated points have no leverage
    shares, found = naive.leverages(xy, normal), np.zeros(n)
    leverage(view.points, view.normals, n, np.zeros((3, 3)), found)
    assert found == pytest.approx(shares, rel=1e-4, abs=1e-6)
    first = view.moments[5, : n + 1]
    jumps = set(np.flatnonzero(np.diff(first))) | set(np.flatnonzero(np.diff(first))[:-1] + 1)
    edges = np.isin(np.arange(n), list(jumps))
    each = min(0.25 * count / edges.sum(), 1.0)
    far = np.hypot(*xy.T)
    rest = 0.5 * (count - each * edges.sum())
    expected = naive.spread_out(each * edges + rest * (shares / 3.0 + far / far.sum()))
    both = set(map(tuple, view.ends.tolist())) ^ set(map(tuple, xy[expected].tolist()))
    assert len(both) <= 4  # a sum that rounds to the other side


def test_at_most_half_of_the_points_are_rays_unless_they_are_few():
    for beams, rays in ((361, 150), (101, MIN_CRITICAL_RAYS), (41, 41)):
        reader = ScanReader(CrsmParams(critical_rays=150))
        reader.read(scan_at(IDENTITY, laser(beams)), IDENTITY)
        assert len(reader.ends) == pytest.approx(rays, abs=0.1 * rays)


def test_information_of_the_rays_is_that_of_their_share_of_all_points():
    view, theta = reader_of(scan_at(IDENTITY, LASER)), 0.7
    c, s = np.cos(theta), np.sin(theta)
    turn = np.array([[c, -s], [s, c]])
    xy, normal = (turn @ a[:2, : view.n] for a in (view.points, view.normals))
    rows = np.stack((*normal, normal[1] * xy[0] - normal[0] * xy[1]))
    expected = rows @ rows.T * len(view.ends) / view.n / view.noise**2
    assert view.information(theta) == pytest.approx(expected, rel=1e-4)


def test_a_single_short_beam_does_not_tear_a_wall():
    scan = scan_at(IDENTITY, LASER)
    ranges = scan.ranges.copy()
    ranges[100:300:7] *= 0.5
    whole, reader = reader_of(scan), reader_of(Scan(0.0, ranges, LASER))
    assert reader.n == whole.n - len(ranges[100:300:7])
    stretches = len(np.unique(reader.moments[5, : reader.n]))
    assert stretches <= len(np.unique(whole.moments[5, : whole.n])) + 1


@pytest.mark.parametrize(("preset", "gray"), [("crsm", -1.0 / 3.0), ("crsm@paper", -1.0)])
def test_one_beam_frees_an_unknown_cell_in_the_preset_of_the_paper_alone(preset, gray):
    """In the default an unknown cell has a weight."""
    slam = made(preset)
    slam.update(scan_at(IDENTITY, laser(361)))
    assert slam._map.levels[0].gray.min() == pytest.approx(gray, abs=1e-6)
