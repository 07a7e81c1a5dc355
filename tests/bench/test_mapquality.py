"""Map quality against closed forms, a naive twin and worlds seen from known places."""

import dataclasses
import math
from functools import cache

import numpy as np
import pytest

from bench.judge.mapquality import compare, truth_map
from bench.sim.setting import Setting
from bench.sim.simulation import simulate, world_of
from slams.types import IDENTITY, OccupancyGrid, Pose2

CELL = 0.05
SIDE = 60  # cells of the room's inner side


def room(thickness=1):
    """A square room with walls as thick as that, nothing known beyond."""
    p = np.full((SIDE + 10, SIDE + 10), np.nan, np.float32)
    p[5 - thickness : SIDE + 5 + thickness, 5 - thickness : SIDE + 5 + thickness] = 1.0
    p[5:-5, 5:-5] = 0.0
    return OccupancyGrid(p, CELL, (-1.0, -2.0))


def moved(grid, dx=0.0, dy=0.0):
    x, y = grid.origin
    return OccupancyGrid(grid.p, grid.resolution, (x + dx, y + dy))


def test_the_frame_is_taken_out():
    """The same room, with a block off its middle, in a frame moved and turned by 90 degrees."""
    truth = room()
    truth.p[20:30, 40:45] = 1.0
    x, y = truth.origin
    shifted = OccupancyGrid(truth.p, CELL, (x - 0.3, y + 0.7))
    assert compare(shifted, truth, Pose2(0.3, -0.7, 0.0))["iou"] == 1.0
    # x of the map looks along the world's y, y against the world's x
    turned = np.ascontiguousarray(truth.p.T[::-1])
    grid = OccupancyGrid(turned, CELL, (y - 2.0, 1.0 - (x + 70 * CELL)))
    found = compare(grid, truth, Pose2(1.0, 2.0, 0.5 * math.pi))
    assert found["iou"] == found["coverage"] == 1.0
    assert found["adnn_to_truth"] == pytest.approx(0.0, abs=1e-12)
    assert compare(grid, truth, Pose2(1.0, 2.0, -0.5 * math.pi))["coverage"] < 0.9


def by_hand(grid, truth):
    """What `compare` measures of maps in one frame whose cells lie on each other, cell by cell."""
    step = [round(v / grid.resolution) for v in np.subtract(truth.origin, grid.origin)[::-1]]
    here, there = (np.argwhere(one.p > 0.5) for one in (grid, truth))
    known, true = (
        {tuple(cell) for cell in np.argwhere(np.isfinite(p) & (p != 0.5)) + by}
        for p, by in ((grid.p, (0, 0)), (truth.p, step))
    )
    both, walls = known & true, {tuple(cell) for cell in here}
    true_walls = {tuple(cell) for cell in there + step}
    off = grid.resolution * np.hypot(*(here[:, None] - there - step).T)
    return {
        "iou": len(walls & true_walls) / len((walls | true_walls) & both),
        "adnn_to_truth": off.min(axis=0).mean(),
        "adnn_from_truth": off.min(axis=1).mean(),
        "coverage": len(both) / len(true),
    }


@pytest.mark.parametrize("shift", [(0, 0), (1, 0), (-2, 3)])
def test_maps_are_compared_as_by_hand_cell_by_cell(shift):
    """Walls that are missing, walls that stand too thick, cells of which nothing is known."""
    rng, truth = np.random.default_rng(0), room()
    p = np.where(
        rng.random(truth.p.shape) < 0.2,
        rng.choice((0.0, 0.5, 1.0, np.nan), truth.p.shape),
        room(3).p,
    )
    p[20:40, 30:] = np.where(rng.random((20, SIDE - 20)) < 0.5, 0.5, np.nan)
    grid = moved(OccupancyGrid(p.astype(np.float32), CELL, truth.origin), *np.multiply(CELL, shift))
    found = compare(grid, truth, IDENTITY)
    expected = by_hand(grid, truth)
    assert {name: found[name] for name in expected} == pytest.approx(expected)


def test_thickness_of_a_long_wall_in_closed_form():
    for k, length in ((1, 150), (2, 150), (3, 400)):
        p = np.zeros((40, length + 20), np.float32)
        p[10 : 10 + k, 10 : 10 + length] = 1.0
        found = compare(OccupancyGrid(p, CELL, (0.0, 0.0)), room(), IDENTITY)["wall_thickness"]
        half = (length + k + math.sqrt(2.0) * (length + k - 1)) / (1.0 + math.sqrt(2.0))
        assert found == pytest.approx(CELL * k * length / half)


def test_thickness_does_not_depend_on_the_wall_s_direction():
    y, x = np.mgrid[0:600, 0:600] * 0.02
    for degrees in (0.0, 22.5, 45.0, 80.0):
        angle = math.radians(degrees)
        across = np.abs((y - 6.0) * math.cos(angle) - (x - 6.0) * math.sin(angle))
        grid = OccupancyGrid((across < 0.15).astype(np.float32), 0.02, (0.0, 0.0))
        assert compare(grid, room(), IDENTITY)["wall_thickness"] == pytest.approx(0.3, rel=0.1)


@pytest.mark.parametrize("parts", [2, 5])
def test_true_walls_thinner_than_a_cell_still_fill_it(parts):
    truth, n = room(), parts * (SIDE + 10)
    thin = np.full((n, n), np.nan, np.float32)
    first, last = 5 * parts - 1, n - 5 * parts
    thin[first : last + 1, first : last + 1] = 1.0
    thin[first + 1 : last, first + 1 : last] = 0.0
    found = compare(truth, OccupancyGrid(thin, CELL / parts, truth.origin), IDENTITY)
    assert found["iou"] == 1.0


def test_what_cannot_be_judged_is_marked():
    nothing = OccupancyGrid(np.full((30, 30), np.nan, np.float32), CELL, (0.0, 0.0))
    for found in (compare(nothing, room(), IDENTITY), compare(nothing, nothing, IDENTITY)):
        known = {name for name, value in found.items() if value is not None}
        assert known <= {"coverage", "true_wall_thickness"}
    found = compare(nothing, room(), IDENTITY)
    assert found["coverage"] == 0.0
    unseen = compare(room(), nothing, IDENTITY)
    assert unseen["iou"] is None and unseen["coverage"] is None
    elsewhere = compare(moved(room(), 100.0), room(), IDENTITY)
    assert elsewhere["iou"] is None


@cache
def log_of(**changes):
    return simulate(dataclasses.replace(Setting(size=8.0, duration=20.0, noise=0.0), **changes))


def test_the_true_map_is_what_could_be_seen():
    log = log_of()
    world, truth = world_of(log), truth_map(log)
    assert truth.p.shape == world.occupied.shape and truth.origin == world.origin
    free, walls, unknown = truth.p == 0.0, truth.p == 1.0, np.isnan(truth.p)
    assert not (free & ~world.free).any() and not (walls & ~world.occupied).any()
    assert (world.free & unknown).any() and (world.occupied & unknown).any()
    beside = np.pad(free, 1)
    beside = beside[:-2, 1:-1] | beside[2:, 1:-1] | beside[1:-1, :-2] | beside[1:-1, 2:]
    assert not (walls & ~beside).any()
    poses = log.truth_at(log.t)[::20]
    rays = np.concatenate([poses + np.array([0.0, 0.0, a]) for a in log.laser.angles[::8]])
    r = world.cast(rays)
    direction = np.stack([np.cos(rays[:, 2]), np.sin(rays[:, 2])], axis=1)
    hits = world.cells_of(rays[:, :2] + (r + 1e-6)[:, None] * direction)
    assert walls[hits].mean() > 0.995
    for share in (0.1, 0.5, 0.9):
        assert free[world.cells_of(rays[:, :2] + (share * r)[:, None] * direction)].mean() > 0.995


def test_nothing_behind_walls_is_seen():
    """Each free cell known has a straight sight to one of the poses, but for their rims."""
    log = log_of()
    world, truth = world_of(log), truth_map(log, max_viewpoints=10)
    poses = log.truth_at(log.t)[:: math.ceil(len(log) / 10)]
    rng = np.random.default_rng(1)
    cells = rng.permutation(np.argwhere(truth.p == 0.0))[:1500]
    centers = (cells[:, ::-1] + 0.5) * world.resolution + np.array(world.origin)
    gap = centers[:, None] - poses[None, :, :2]
    distance, direction = np.hypot(*gap.T).T, np.arctan2(gap[..., 1], gap[..., 0])
    x, y, angle = np.broadcast_arrays(poses[:, 0], poses[:, 1], direction)
    rays = np.column_stack([x.ravel(), y.ravel(), angle.ravel()])
    sight = world.cast(rays).reshape(distance.shape) > distance - 2.0 * world.resolution
    assert sight.any(axis=1).mean() > 0.99


def test_the_true_map_knows_the_laser_s_limits_and_its_sweep():
    near = truth_map(log_of(sensor="lds01"))
    far = truth_map(log_of(sensor="rplidar-a1"))
    assert np.isfinite(near.p).sum() < np.isfinite(far.p).sum()
    swept = truth_map(log_of(sensor="rplidar-a1", sweep=True))
    assert (np.isfinite(swept.p) == np.isfinite(far.p)).mean() > 0.98


def test_no_true_map_of_a_real_log():
    log = log_of()
    assert truth_map(dataclasses.replace(log, meta={})) is None
    assert truth_map(dataclasses.replace(log, truth=None)) is None


def test_maps_of_other_resolutions():
    """The same walls in cells of half the size, and of twice."""
    truth = room()
    fine = OccupancyGrid(truth.p.repeat(2, axis=0).repeat(2, axis=1), CELL / 2, truth.origin)
    found = compare(fine, truth, IDENTITY)
    assert found["iou"] == found["coverage"] == 1.0
    off = CELL / 4 * math.sqrt(2.0)
    assert found["adnn_to_truth"] == pytest.approx(off)
    assert found["adnn_from_truth"] == pytest.approx(off)
    back = compare(truth, fine, IDENTITY)
    assert back["iou"] == back["coverage"] == 1.0
    assert back["adnn_to_truth"] == pytest.approx(off)
