"""Growing maps: where the robot can have driven, within a limit, memory only where written."""

import dataclasses
import math
import tracemalloc
from functools import cache

import numpy as np
import pytest
from numpy.lib.array_utils import byte_bounds

from slams.cells import PAGE_SIZE, PAGEMAP, GridStorage, move, nonzero_spans, used_pages, zeros
from slams.grid_bounds import MAX_DISTANCE_FROM_MAP, Box, GridBounds
from slams.player import WARM_UP_SCANS, replay, warm_up
from slams.registry import create, find
from slams.scanlog import TimeSeries
from slams.summary import as_text, summarize
from tests.rooms import ALGORITHMS, ORIGINALS, drive

needs_pagemap = pytest.mark.skipif(not PAGEMAP.exists(), reason="only Linux lists the pages in use")


def taken(array):
    """Bytes of memory that an array takes at most."""
    return int(used_pages(*byte_bounds(array)).sum()) * PAGE_SIZE


@needs_pagemap
def test_memory_is_taken_where_it_is_written_to():
    array = zeros((4096, 4096), np.float32)
    assert taken(array) == 0
    array[1000, 7] = array[3000, 4095] = 1.0
    assert taken(array) == 2 * PAGE_SIZE


def test_without_a_page_map_all_pages_count(monkeypatch, tmp_path):
    monkeypatch.setattr("slams.cells.PAGEMAP", tmp_path / "none")
    array = zeros((64, 4096), np.float32)
    array[3, 3000] = 1.0
    assert used_pages(0, 10 * PAGE_SIZE).all()
    block = (3 * 4 * 4096 + 4 * 3000) // PAGE_SIZE * PAGE_SIZE
    assert nonzero_spans(array) == [(block, block + PAGE_SIZE)]


def test_a_room_is_a_square_around_the_origin():
    room = GridStorage(2_500, 0.1, block=4)
    assert (room.width, room.height) == (96, 96)
    assert room.corner == pytest.approx((-4.8, -4.8))
    assert room.reach(Box(-4.75, -4.8, 4.8, 4.75)) is None
    assert room.window(Box(-4.75, -0.05, 0.25, 9.0)) == (slice(47, 96), slice(0, 51))


def test_rows_of_a_large_room_are_no_whole_pages():
    room = GridStorage(1 << 24, 0.05, block=4)
    assert (room.width, room.height) == (8196, 8192)
    assert room.corner == pytest.approx((-204.8, -204.8))


@pytest.mark.parametrize(
    ("box", "added"),
    [
        (Box(-5.0, 0.0, 0.0, 0.0), (0, 52)),
        (Box(0.0, -6.0, 0.0, 0.0), (60, 0)),
        (Box(0.0, 0.0, 5.0, 0.0), (0, 0)),
        (Box(0.0, 0.0, 0.0, 7.3), (0, 0)),
    ],
)
def test_a_room_grows_in_blocks_to_the_side_it_needs(box, added):
    room, before = GridStorage(2_500, 0.1, block=4), GridStorage(2_500, 0.1, block=4)
    assert room.reach(box) == added
    assert room.reach(box) is None
    assert (before.y0 - room.y0, before.x0 - room.x0) == added
    grown = room.width + room.height - before.width - before.height
    assert grown >= 48
    assert room.width % 4 == room.height % 4 == room.x0 % 4 == room.y0 % 4 == 0


@pytest.mark.parametrize("rest", [(), (3,)])
def test_what_grows_keeps_its_cells(rest):
    rng = np.random.default_rng(3)
    small, large = zeros((200, 300, *rest), np.float32), zeros((400, 500, *rest), np.float32)
    small[::7, 20:90] = rng.random((29, 70, *rest))
    small[199, 299] = 1.0
    move(small, large, 50, 60)
    np.testing.assert_array_equal(large[50:250, 60:360], small)
    assert np.count_nonzero(large) == np.count_nonzero(small)


@needs_pagemap
def test_what_grows_stays_untouched_where_it_was():
    small, large = zeros((512, 4096), np.float32), zeros((1024, 8192), np.float32)
    small[300, 2000] = 1.0
    move(small, large, 100, 1000)
    assert taken(large) == PAGE_SIZE


@needs_pagemap
def test_of_a_large_room_the_written_blocks_are_known():
    array = zeros((1 << 15, 1 << 14), np.float32)  # 2 GB
    array[20_000, 5] = array[-1, -9] = 1.0
    array[0, :9] = 0.0  # written to, and zero
    block = 20_000 * (4 << 14)
    last = array.nbytes - PAGE_SIZE
    assert nonzero_spans(array) == [(at, at + PAGE_SIZE) for at in (block, last)]


@pytest.mark.parametrize("offset", [0, 1, PAGE_SIZE - 3, PAGE_SIZE])
def test_blocks_count_from_where_an_array_begins(offset):
    array = zeros((20 * PAGE_SIZE,), np.uint8)[offset : offset + 9 * PAGE_SIZE + 7]
    array[[2 * PAGE_SIZE, 3 * PAGE_SIZE, 8 * PAGE_SIZE - 1, len(array) - 1]] = 1
    pages = [(PAGE_SIZE * first, PAGE_SIZE * after) for first, after in ((2, 4), (7, 8))]
    assert nonzero_spans(array) == [*pages, (9 * PAGE_SIZE, len(array))]


@pytest.mark.parametrize("name", ["hector", "crsm"])
def test_a_map_that_outgrows_its_room_is_the_same_in_a_larger_one(name, monkeypatch):
    log, roomy = drive(n=60), create(name)
    monkeypatch.setattr(
        f"{name}.map.GridStorage", lambda _, cell, block: GridStorage(1 << 12, cell, block)
    )
    narrow = create(name)
    first = narrow._map._storage.width
    for scan in log:
        np.testing.assert_allclose(narrow.update(scan), roomy.update(scan), atol=1e-6)
    assert narrow._map._storage.width > first
    one, other = narrow.map(), roomy.map()
    np.testing.assert_allclose(one.origin, other.origin)
    np.testing.assert_allclose(one.p, other.p, atol=1e-3)


LABELS = [*ALGORITHMS, *ORIGINALS]
GROWING = [label for label in LABELS if "max_cells" in find(label).params().specs()]


def test_a_map_may_grow_step_by_step_but_not_jump():
    extent = GridBounds(1 << 26, 0.05)
    assert extent.admits(Box.around(0.99 * MAX_DISTANCE_FROM_MAP, 0.0, 10.0))
    assert extent.admits(Box.around(1.98 * MAX_DISTANCE_FROM_MAP, 0.0, 10.0))
    covered = extent.covered
    for x in (4.0 * MAX_DISTANCE_FROM_MAP, 1e300, math.inf, math.nan):
        assert not extent.admits(Box.around(x, 0.0, 10.0))
    assert extent.counts == {"too_far": 4, "too_large": 0}
    assert extent.covered == covered


def test_a_map_that_is_full_still_takes_what_is_inside():
    extent = GridBounds(10_000, 0.1)
    assert extent.admits(Box(-5.0, -5.0, 4.9, 4.9))
    assert not extent.admits(Box(4.0, 0.0, 6.0, 1.0))
    assert not extent.admits(Box(0.0, 0.0, math.inf, 1.0))
    assert extent.admits(Box(-5.0, 0.0, 4.9, 1.0))
    assert extent.counts == {"too_far": 1, "too_large": 1}


def kept_mb(label, log, **changes):
    entry = find(label)
    params = entry.params().replace(**changes)
    warm_up(entry.cls, params, log.select(WARM_UP_SCANS))  # compiling, too, takes memory
    tracemalloc.start()
    try:
        slam = entry.cls(params)
        run = replay(slam, log)
        grid = slam.map()
        return slam, run, grid, tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


@cache
def typical_mb(label):
    return kept_mb(label, drive(n=40))[3]


@pytest.mark.parametrize("label", LABELS)
@pytest.mark.parametrize("meters", [1e3, 1e6])
def test_odometry_that_jumps_costs_no_memory(label, meters):
    typical, log = typical_mb(label), drive(n=40)
    values = log.odom.values.copy()
    values[20:, 1] += meters
    jumped = dataclasses.replace(log, odom=TimeSeries(log.odom.t, values))
    slam, run, grid, mb = kept_mb(label, jumped)
    assert mb < typical + 50.0, f"{mb:.0f} MB instead of {typical:.0f}"
    assert grid.p.size < 1.1e6
    assert np.isfinite(run.poses).all()
    report = slam.report()
    if np.abs(run.poses[-1, 1]) > MAX_DISTANCE_FROM_MAP and label in GROWING:
        assert report["too_far"] > 0


@pytest.mark.parametrize("label", GROWING)
def test_a_map_at_its_limit_stops_growing_and_reports_it(label):
    entry, log = find(label), drive(n=40)
    resolution = {"crsm": 0.02, "crsm@original": 0.005, "tsd@original": 0.01}.get(label, 0.02)
    cell = "resolution" if "resolution" in entry.params().specs() else "cell"
    slam, run, grid, _ = kept_mb(label, log, max_cells=1 << 16, **{cell: resolution})
    assert slam.report()["too_large"] > 0
    assert np.isfinite(run.poses).all()
    assert grid.p.size < 1 << 22, "what the first map has, nothing more"
    text = as_text(summarize(run, log, label, entry.params(), 0.0))
    assert "it has reached max_cells" in text
