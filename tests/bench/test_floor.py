"""Maps at the true poses: the plain mapper against a naive twin, and what it makes of arenas."""

import dataclasses
import math
from functools import cache

import numpy as np
import pytest

from bench.judge.mapquality import truth_map
from bench.run import floor
from bench.run.floor import AT_TRUTH, ODDS, floor_rows
from bench.run.floor_kernels import PlainMap, insert_scans
from bench.sim.setting import Setting
from bench.sim.simulation import simulate
from slams.scanlog import Track

TRUE = "true map in cells of 5 cm"


@cache
def log_of(**changes):
    return simulate(dataclasses.replace(Setting(size=8.0, duration=6.0), **changes))


def empty(ny=20, nx=30):
    return PlainMap(np.zeros((ny, nx)), np.zeros((ny, nx), np.int32))


def insert(grid, rays, ranges, first=1, odds=ODDS):
    shape = (-1, len(ranges), 3)
    insert_scans(grid, np.array(rays).reshape(shape), np.array([ranges], np.float32), first, odds)


def test_a_ray_frees_what_it_passes_and_fills_where_it_ends():
    rng = np.random.default_rng(0)
    for _ in range(200):
        ray = [rng.uniform(0, 30), rng.uniform(0, 20), rng.uniform(-4, 4)]
        r = np.float32(rng.uniform(0.0, 25.0))
        grid = empty()
        insert(grid, ray, [r])
        c, s = math.cos(ray[2]), math.sin(ray[2])
        along = np.linspace(0.0, float(r), 20_000)
        cells = np.floor(np.stack([ray[1] + s * along, ray[0] + c * along])).astype(int)
        end = cells[:, -1]
        inside = (cells >= 0).all(axis=0) & (cells[0] < 20) & (cells[1] < 30)
        naive = np.zeros((20, 30))
        naive[tuple(cells[:, inside])] = ODDS.miss
        if inside[-1]:
            naive[tuple(end)] = ODDS.hit
        # fine steps miss a corner that is cut by less
        assert (grid.log_odds != naive).sum() <= 1
        assert (naive != 0.0).sum() <= (grid.log_odds != 0.0).sum()


def test_a_ray_along_an_axis():
    for direction, cells in ((0.0, (10, slice(5, 9))), (0.5 * math.pi, (slice(10, 14), 5))):
        grid = empty()
        insert(grid, [5.5, 10.5, direction], [4.0])
        naive = np.zeros((20, 30))
        naive[cells] = ODDS.miss
        naive[(10, 9) if direction == 0.0 else (14, 5)] = ODDS.hit
        assert np.array_equal(grid.log_odds, naive)


def test_a_scan_changes_a_cell_once_and_a_hit_wins():
    grid = empty()
    fan = [[5.5, 10.5, 0.0], [5.5, 10.6, 0.0], [5.5, 10.4, 0.0]]
    insert(grid, fan, [9.0, 4.0, math.nan])
    assert grid.log_odds[10, 5] == ODDS.miss
    assert grid.log_odds[10, 9] == ODDS.hit, "another beam of the scan goes through"
    insert(grid, fan, [9.0, math.inf, math.nan], first=2)
    assert grid.log_odds[10, 9] == pytest.approx(ODDS.hit + ODDS.miss)
    for k in range(3, 30):
        insert(grid, fan, [9.0, 9.0, 9.0], first=k)
    assert grid.log_odds[10, 9] == ODDS.low
    assert grid.log_odds[10, 14] == ODDS.high


def test_the_true_map_in_cells_is_as_good_as_cells_are():
    found = floor_rows(log_of())[TRUE]
    assert found.iou.value == 1.0 and found.coverage.value == 1.0
    assert 0.01 < found.adnn_to_truth.value < 0.02
    assert found.wall_thickness.value == found.true_wall_thickness.value


@pytest.mark.parametrize(
    "changes", [{}, {"sensor": "lds02", "sweep": True, "noise": 0.01, "duration": 30.0}]
)
def test_the_plain_mapper_draws_the_arena(changes):
    """A laser that sweeps at 5 Hz turns by 9 degrees during a scan."""
    log = log_of(**changes)
    found = floor_rows(log)[AT_TRUTH]
    assert found.iou.value > 0.7
    assert found.adnn_to_truth.value < 0.03
    assert found.coverage.value > 0.9


def test_poses_that_are_off_spoil_the_map():
    log = log_of()
    truth = truth_map(log)
    values = log.truth.values.copy()
    values[len(values) // 2 :, :2] += 0.1
    off = dataclasses.replace(log, truth=Track(log.truth.t, values))
    good, bad = (floor_rows(one, truth)[AT_TRUTH] for one in (log, off))
    assert bad.iou.value < 0.7 * good.iou.value
    assert bad.adnn_to_truth.value > 1.3 * good.adnn_to_truth.value


def test_scans_are_taken_evenly_and_all_of_them_in_blocks(monkeypatch):
    log = log_of()
    whole = floor_rows(log)[AT_TRUTH]
    monkeypatch.setattr(floor, "BLOCK", 7)
    assert floor_rows(log)[AT_TRUTH] == whole
    monkeypatch.setattr(floor, "POSES", 40)
    thinned = floor_rows(log)[AT_TRUTH]
    assert thinned != whole
    assert thinned.coverage.value > 0.8 * whole.coverage.value


def test_a_log_without_a_world_or_a_first_truth_has_no_floor():
    log = log_of()
    assert floor_rows(dataclasses.replace(log, meta={})) == {}
    assert floor_rows(dataclasses.replace(log, truth=None)) == {}
    late = Track(log.truth.t[50:], log.truth.values[50:])
    assert floor_rows(dataclasses.replace(log, truth=late)) == {}
