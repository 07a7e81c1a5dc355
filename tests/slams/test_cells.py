"""Room for maps that grow: memory only where something was written, and moves of what grows."""

import numpy as np
import pytest
from numpy.lib.array_utils import byte_bounds

from slams.cells import (
    PAGE,
    PAGEMAP,
    Room,
    filled,
    given_pages,
    move,
    runs,
    zeros,
)
from slams.grid_bounds import Box
from slams.registry import find
from tests.rooms import drive

needs_pagemap = pytest.mark.skipif(
    not PAGEMAP.exists(), reason="only Linux tells which pages it gave"
)


def taken(array):
    """Bytes of memory that an array takes at most."""
    return int(given_pages(*byte_bounds(array)).sum()) * PAGE


def test_runs_have_their_firsts_and_lengths():
    assert runs(np.array([True, False, True, True])) == [(0, 1), (2, 2)]
    assert runs(np.zeros(0, np.bool_)) == []


@needs_pagemap
def test_memory_is_taken_where_it_is_written_to():
    array = zeros((4096, 4096), np.float32)
    assert taken(array) == 0
    array[1000, 7] = array[3000, 4095] = 1.0
    assert taken(array) == 2 * PAGE


def test_without_the_system_telling_all_pages_count(monkeypatch, tmp_path):
    monkeypatch.setattr("slams.cells.PAGEMAP", tmp_path / "none")
    array = zeros((64, 4096), np.float32)
    array[3, 3000] = 1.0
    assert given_pages(0, 10 * PAGE).all()
    block = (3 * 4 * 4096 + 4 * 3000) // PAGE * PAGE
    assert filled(array) == [(block, block + PAGE)]


def test_a_room_is_a_square_around_the_origin():
    room = Room(2_500, 0.1, block=4)
    assert (room.width, room.height) == (96, 96)
    assert room.corner == pytest.approx((-4.8, -4.8))
    assert room.reach(Box(-4.75, -4.8, 4.8, 4.75)) is None
    assert room.window(Box(-4.75, -0.05, 0.25, 9.0)) == (slice(47, 96), slice(0, 51))


def test_rows_of_a_large_room_are_no_whole_pages():
    room = Room(1 << 24, 0.05, block=4)
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
    room, before = Room(2_500, 0.1, block=4), Room(2_500, 0.1, block=4)
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
    assert taken(large) == PAGE


@needs_pagemap
def test_of_a_large_room_the_written_blocks_are_known():
    array = zeros((1 << 15, 1 << 14), np.float32)  # 2 GB
    array[20_000, 5] = array[-1, -9] = 1.0
    array[0, :9] = 0.0  # written to, and zero
    block = 20_000 * (4 << 14)
    assert filled(array) == [(block, block + PAGE), (array.nbytes - PAGE, array.nbytes)]


@pytest.mark.parametrize("offset", [0, 1, PAGE - 3, PAGE])
def test_blocks_count_from_where_an_array_begins(offset):
    array = zeros((20 * PAGE,), np.uint8)[offset : offset + 9 * PAGE + 7]
    array[[2 * PAGE, 3 * PAGE, 8 * PAGE - 1, len(array) - 1]] = 1
    spans = [(2 * PAGE, 4 * PAGE), (7 * PAGE, 8 * PAGE), (9 * PAGE, len(array))]
    assert filled(array) == spans


@pytest.mark.parametrize("name", ["hector", "crsm"])
def test_a_map_that_outgrows_its_room_is_the_same_in_a_larger_one(name, monkeypatch):
    log, entry = drive(n=60), find(name)
    roomy = entry.cls(entry.params())
    monkeypatch.setattr(f"{name}.map.Room", lambda _, cell, block: Room(1 << 12, cell, block))
    narrow = entry.cls(entry.params())
    first = narrow._map._room.width
    for scan in log:
        np.testing.assert_allclose(narrow.update(scan), roomy.update(scan), atol=1e-6)
    assert narrow._map._room.width > first
    one, other = narrow.map(), roomy.map()
    np.testing.assert_allclose(one.origin, other.origin)
    np.testing.assert_allclose(one.p, other.p, atol=1e-3)
