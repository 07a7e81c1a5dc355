"""tsd: the field of signed distances, and the maps drawn from it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slams.grid_bounds import Box
from slams.scan.end_points import EndPoints
from slams.types import Pose2
from tests.floors import is_wall
from tests.rooms import box, drive, driven, error, laser, scan_at
from tests.tsd import naive as naive_tsd
from tests.tsd.cases import BOX, CORNER, PLANE, default, field_at, field_of, scanned
from tsd.drawing import surface_cells
from tsd.map_kernels import (
    BEHIND_BIT,
    PASS_BITS,
    PushRule,
    allocate_tile,
    carve,
    decay_cell,
    layer_of,
    list_rows,
    push_rows,
    read_field,
    second_layer_of,
)
from tsd.params import TsdParams


@pytest.mark.parametrize("heading", [0.0, 0.4, 0.785])
def test_a_plane_has_its_analytic_distances(heading):
    slam = default()
    slam.update(scan_at((0.0, 0.0, heading), laser(721), PLANE))
    map_from_world = Pose2(0.0, 0.0, heading).inverse()
    normal = map_from_world.transform(np.array([[0.0, -1.0]]))[0]
    for x in np.linspace(-1.5, 1.5, 13):
        for sd in (-0.03, 0.0, 0.03, 0.06):
            point = map_from_world.transform(np.array([[x, 2.0 - sd]]))[0]
            value, gx, gy = field_at(slam, *point, normal)
            assert value == pytest.approx(sd, abs=1e-3)
            assert (gx, gy) == pytest.approx(tuple(normal), abs=0.02)


def test_a_corner_keeps_each_wall_in_its_own_layer():
    slam = default()
    slam.update(scan_at((0.0, 0.0, 0.0), laser(721), CORNER))
    for t in (0.2, 0.5):
        for sd in (-0.05, 0.05):
            assert field_at(slam, 3.0 - t, 2.0 - sd, (0, -1))[0] == pytest.approx(sd, abs=2e-3)
            assert field_at(slam, 3.0 - sd, 2.0 - t, (-1, 0))[0] == pytest.approx(sd, abs=2e-3)


def test_both_sides_of_a_thin_plate_stay_where_they_are():
    plate = np.array([*box(-0.5, 1.0, 0.5, 1.02), *box(-4.0, -3.0, 4.0, 3.0)])
    slam = default()
    rng = np.random.default_rng(1)
    path = [(1.6 * math.sin(a), 1.0 - 1.6 * math.cos(a), a) for a in np.linspace(0, 6.2, 250)]
    first = Pose2(*path[0])
    for i, pose in enumerate(path):
        found = slam.update(scan_at(pose, laser(721), plate, 0.01, rng, 0.05 * i))
        distance, turn = error(first.between(Pose2(*pose)), found)
        assert distance < 0.01 and turn < 0.005
    for sd in (-0.03, 0.0, 0.05):
        low = first.inverse().transform(np.array([[0.0, 1.0 - sd]]))[0]
        high = first.inverse().transform(np.array([[0.0, 1.02 + sd]]))[0]
        assert field_at(slam, *low, (0, -1))[0] == pytest.approx(sd, abs=0.006)
        assert field_at(slam, *high, (0, 1))[0] == pytest.approx(sd, abs=0.006)


def test_gradient_is_the_interpolants():
    slam = driven("tsd", drive(n=30, lidar=laser(361)))
    kernel = slam._map.kernel
    rng = np.random.default_rng(2)
    checked = 0
    for _ in range(12000):
        x, y = rng.uniform(-4.5, 4.5, 2)
        layer, h = int(rng.integers(4)), 1e-5
        value, gx, gy = read_field(kernel, layer, x, y)
        around = [
            read_field(kernel, layer, x + a, y + b)[0]
            for a, b in ((h, 0), (-h, 0), (0, h), (0, -h))
        ]
        if np.isfinite([value, *around]).all():
            checked += 1
            assert gx == pytest.approx((around[0] - around[1]) / (2 * h), abs=1e-2)
            assert gy == pytest.approx((around[2] - around[3]) / (2 * h), abs=1e-2)
    assert checked > 50


def test_push_blends_every_line_into_its_cells():
    field = field_of(max_weight=3.0)
    field.extent.covered = Box(0.0, -1.0, 2.0, 1.0)
    rule = PushRule(0.15, 3.0, 0.2)
    rng, rows = np.random.default_rng(6), np.zeros((999, 4))
    lines = np.array([[1.0, 0.02 * rng.normal(), -0.05 * k, 1.0, 0.9, 1.0, 0.0] for k in range(5)])
    lines[:, 2:4] /= np.hypot(lines[:, 2], lines[:, 3])[:, None]
    for k in range(5):
        n = list_rows(field.kernel, lines[k : k + 1], 1, rule, rows)
        push_rows(field.kernel, lines[k : k + 1], rows, n, rule)
    weights = field.kernel._replace(tsd=field.kernel.weight)
    for y in (-0.075, -0.025, 0.025, 0.075):
        sd, center, _ = naive_tsd.cell_of(field.kernel, 1, 1.01, y)
        value, total = naive_tsd.pushed_cell(lines[:, :5], *center, 0.15, 3.0)
        assert sd == pytest.approx(value, abs=1e-5)
        assert naive_tsd.cell_of(weights, 1, 1.01, y)[0] == pytest.approx(total, rel=1e-5)
    x, y, nx, ny = lines[:, :4].T
    top = (y - (center[0] - x) * nx / ny + 0.15 / ny).max()
    assert naive_tsd.cell_of(weights, 1, 1.01, top + 0.025)[0] == 0.0
    for y, behind in ((-0.125, True), (0.025, False)):
        ix, iy = ((np.array([1.01, y]) - field.kernel.corner) / 0.05).astype(int)
        assert bool(field.kernel.cell_state[iy, ix] & BEHIND_BIT) == behind


@pytest.mark.parametrize("degrees", range(20, 380, 50))
def test_the_layers_of_a_normal_are_those_of_the_two_nearest_axes(degrees):
    x, y = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    nearest = np.argsort([-x, -y, x, y])  # of +x, +y, -x, -y
    assert [layer_of(x, y), second_layer_of(x, y)] == nearest[:2].tolist()


@pytest.mark.parametrize("layer", range(4))
def test_a_surface_is_one_cell_wide_where_it_crosses(layer):
    x = (np.arange(12) + 0.5) * 0.05
    tsd = np.tile((x - 0.31) * (1 if layer < 2 else -1), (9, 1)).astype(np.float32)
    cells = surface_cells(tsd, layer, 0.05)
    assert (cells.sum(axis=1) == 1).all() and cells[:, 6].all()
    assert not surface_cells(-tsd, layer, 0.05).any()  # faces the other way
    assert not surface_cells(3.0 * tsd, layer, 0.05).any()  # two surfaces, none between
    assert not surface_cells(0.5 * tsd, layer, 0.05).any()  # shows in the other axis' layer


def test_walls_of_the_map_are_thin_and_nothing_else_is_occupied():
    slam = driven("tsd", drive(n=40, segments=BOX))
    grid = slam.map()
    iy, ix = np.nonzero(grid.p > 0.5)
    first = Pose2(*drive(n=1).truth_at(np.zeros(1))[0])
    points = first.transform(np.stack([ix, iy], axis=1) * 0.05 + 0.025 + np.array(grid.origin))
    off = np.min(np.abs(points[:, [0, 0, 1, 1]] - [-3.0, 2.5, -2.0, 2.2]), axis=1)
    assert off.max() < 0.05
    assert np.nanmin(grid.p) < 0.05
    seen = next(iter(drive(n=1, noise=0.0, segments=BOX)))
    ends = seen.ranges[:, None] * seen.laser.directions
    covered = np.mean([is_wall(grid, x, y) for x, y in ends])
    assert covered > 0.98
    assert len(ix) < 400  # the outline is 19.4 m, 388 cells, and not all of it is observed


def test_shares_count_inliers_and_conflicts():
    slam, elements = scanned()
    field, pose, softness = slam._map, slam._estimator.pose, slam._scan.softness
    inliers, conflicts = field.evaluate(slam._scan, pose)
    assert inliers > 0.9 and conflicts < 0.05
    values = []
    for x, y, nx, ny, *_ in elements:
        p = pose.transform(np.array([[x, y]]))[0]
        n = Pose2(0.0, 0.0, pose.theta).transform(np.array([[nx, ny]]))[0]
        values.append(read_field(field.kernel, layer_of(*n), *p)[0])
    known = np.array(values)[np.isfinite(values)]
    assert inliers * len(elements) == pytest.approx((1 / (1 + (known / softness) ** 2)).sum())
    inliers, conflicts = field.evaluate(slam._scan, pose @ Pose2(0.5, 0.4, 0.3))
    assert conflicts > 0.2 and inliers < 0.7
    with pytest.raises(TypeError, match="expected a SurfaceScan"):
        field.evaluate(EndPoints(TsdParams()), pose)


@pytest.mark.parametrize(("label", "more"), [("tsd", {}), ("tsd@original", {"map_size": 9})])
def test_the_map_shows_the_room(label, more):
    slam = driven(label, replace(drive(n=25), yaw_rate=None), **more)
    x0, y0, _ = -1 * np.array(drive(n=1).truth_at(np.zeros(1))[0])
    grid = slam.map()
    assert is_wall(grid, 5.0 + x0, y0) and is_wall(grid, x0, -3.0 + y0)
    ix, iy = (np.array([0.5, 0.5]) - grid.origin) / grid.resolution
    assert grid.p[int(iy), int(ix)] < 0.5


def test_a_sparse_line_is_not_continued_far_beyond_its_hit():
    field = field_of(max_weight=100.0).kernel
    line = np.array([[2.0, 0.0, 0.0, 1.0, 0.2, 8.0, 0.0]])
    rows = np.zeros((999, 4))
    n = list_rows(field, line, 1, PushRule(0.15, 100.0, 0.2), rows)
    along = field.corner[0] + (rows[:n, 2] + 0.5) * 0.05
    assert 4 <= n <= 7 and np.abs(along - 2.0).max() <= 0.15


def test_a_cell_that_one_beam_passed_is_shown_as_free():
    slam = default()
    slam.update(scan_at((0.0, 0.0, 0.0), laser(91)))  # 3 degrees apart
    once = (slam._map.kernel.cell_state & PASS_BITS) == 1
    assert once.sum() > 1000
    assert (slam._map.grid().p < 0.1).sum() > 0.9 * once.sum()


def test_carve_marks_what_every_beam_passes():
    field = field_of(max_weight=100.0).kernel
    gap, laser_at = 0.01, np.array([0.3, -0.2])
    angles = -1.0 + gap * np.arange(200)
    ends = laser_at + 4.02 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    lines = np.column_stack([ends, np.zeros((200, 5))])
    lines[:, 5] = 4.02
    carve(field, lines, 200, *laser_at, PushRule(0.15, 100.0, gap))
    twin = naive_tsd.passed(laser_at, ends, field.corner, 0.05, field.cell_state.shape)
    seen = (field.cell_state & PASS_BITS) > 0
    assert not (seen & ~twin).any()
    assert (twin & ~seen).sum() < 0.02 * twin.sum()  # close by, not every beam is walked
    for _ in range(3):
        carve(field, lines, 200, *laser_at, PushRule(0.15, 100.0, gap))
    assert np.array_equal(field.cell_state, PASS_BITS * seen)  # three are counted, no more


def test_only_what_is_behind_a_surface_decays():
    field = field_of().kernel
    slot = field.slots[0, 0, 0] = allocate_tile(field)
    tsd, weight = field.tsd[slot, 0], field.weight[slot, 0]
    tsd[:4], weight[:4] = (-0.1, -0.1, 0.1, np.nan), (4.0, 0.9, 0.9, 0.0)
    field.likelihood[0, 0] = 0.8
    gone = [decay_cell(field, 0, 0, ix, 0.5, -0.05) for ix in range(4)]
    assert gone == [False, True, False, False] and field.likelihood[0, 0] == 0.0
    np.testing.assert_allclose(weight[:4], (2.0, 0.0, 0.9, 0.0), rtol=1e-6)
    assert np.isnan(tsd[1]) and tsd[2] > 0.0


def test_a_part_of_the_map_copies_its_own_tiles_only():
    slam = default()
    for k in range(2):
        slam.insert_at(scan_at((0.0, 0.0, 0.0), laser(361), t=k), Pose2(30.0 * k, 0.0, 0.0))
    field, part = slam._map, slam._map._window(Box(28.0, -2.0, 32.0, 2.0))
    drawing = field._drawing(part)
    assert len(drawing.tsd) == 1 + np.count_nonzero(drawing.slots) < 0.5 * field.kernel.used[0]
    assert [cells.stop - cells.start for cells in part[0]] == [80, 80]  # 4 m, whole tiles
