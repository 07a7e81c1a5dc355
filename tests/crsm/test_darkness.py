"""The dark field between its cells: quadratic splines, and blots that count less together."""

import math

import numpy as np
import pytest

from crsm.map import WallGrid
from crsm.map_kernels import EDGE, FULL, HALF, ROUND, WEIGHT, WIDTH, X, Y, add_blot, darkness
from crsm.params import CrsmParams
from crsm.scan import ScanReader
from slams.types import IDENTITY, Pose2
from tests.rooms import still


def grid(**changes):
    return WallGrid(CrsmParams(max_cells=1 << 16, **changes)).cells


def spline(d):
    """The quadratic B-spline at a distance [cell]."""
    d = abs(d)
    return 0.75 - d * d if d < 0.5 else 0.5 * max(1.5 - d, 0.0) ** 2


def test_darkness_is_the_spline_of_the_cells_around():
    cells, rng = grid(), np.random.default_rng(0)
    cells.dark[:] = rng.random(cells.dark.shape)
    step, (x0, y0) = cells.cell / cells.sharp, cells.corner
    for u, v in rng.uniform(20.0, 40.0, (20, 2)):
        ix, iy = math.floor(u), math.floor(v)
        total = sum(
            spline(u - i - 0.5) * spline(v - j - 0.5) * cells.dark[j, i]
            for i in range(ix - 2, ix + 3)
            for j in range(iy - 2, iy + 3)
        )
        expected = (1.0 + HALF) * total / (HALF * FULL + total)
        assert darkness(cells, x0 + u * step, y0 + v * step) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("normal", "width", "sigmas"),
    [
        ((1.0, 0.0), 1.0, (1.0, 5.0)),  # a stroke of one map cell along the wall
        ((0.6, 0.8), 1.0, (1.0, 5.0)),
        ((0.6, 0.8), 6.0, (6.0, 6.0)),  # of a noisy laser: not longer than wide
        ((0.0, 0.0), 1.0, (1.0, 1.0)),  # a lone point
    ],
)
def test_a_blot_is_a_stroke_along_its_wall_and_taken_away_leaves_nothing(normal, width, sigmas):
    cells = grid(sharp=5)
    assert cells.stroke * cells.sharp == 5.0
    step, (x0, y0) = cells.cell / cells.sharp, cells.corner
    u, v = 60.3, 55.8
    element = np.array((x0 + u * step, y0 + v * step, *normal, 9.0))
    add_blot(cells, element, width, 1.0)
    nx, ny = normal if any(normal) else (1.0, 0.0)
    iy, ix = np.mgrid[: cells.dark.shape[0], : cells.dark.shape[1]]
    dx, dy = ix + 0.5 - u, iy + 0.5 - v
    square = ((nx * dx + ny * dy) / sigmas[0]) ** 2 + ((nx * dy - ny * dx) / sigmas[1]) ** 2
    expected = np.where(square < EDGE * EDGE, ROUND / cells.stroke * np.exp(-0.5 * square), 0.0)
    assert np.abs(cells.dark - expected).max() < 1e-5
    add_blot(cells, element, width, -1.0)
    assert np.abs(cells.dark).max() < 1e-6


@pytest.mark.parametrize("sharp", [2, 5])
def test_two_faces_of_a_thin_wall_each_have_their_ridge_where_blots_are_narrower(sharp):
    walls = WallGrid(CrsmParams(max_cells=1 << 16, sharp=sharp))
    cells, (x0, y0) = walls.cells, walls.cells.corner
    for at, nx in ((1.02, 1.0), (1.11, -1.0)):
        for k in range(10, 40):
            ix, y = math.floor((x0 + at - x0) / cells.cell), y0 + (k + 0.3) * cells.cell
            cells.wall[k, ix] = x0 + at, y, nx, 0.0, 5.0
            walls._redraw(np.array([k * cells.wall.shape[1] + ix]))
    x, y = x0 + 1.02 + np.arange(-0.03, 0.031, 0.002), y0 + 2.5
    top = x[np.argmax([darkness(cells, at, y) for at in x])] - x0 - 1.02
    assert abs(top) < 0.003 if sharp == 5 else top > 0.01


def test_there_is_a_broad_field_only_beside_a_sharper_one():
    room = ScanReader(CrsmParams())
    room.take(still(0), IDENTITY)
    plain = WallGrid(CrsmParams(max_cells=1 << 20))
    both = WallGrid(CrsmParams(max_cells=1 << 20, sharp=5))
    assert plain.broad is plain.cells
    for walls in (plain, both):
        walls.insert(room, IDENTITY)
        assert walls.insert(room, Pose2(30.0, 3.0, 0.3))  # it grows
    assert both.broad.wall is both.cells.wall
    blots = (both.broad.blot[..., WIDTH] > 0.0) == (both.cells.wall[..., WEIGHT] > 0.0)
    assert blots.all()
    blot = both.broad.dark.sum() / both.cells.dark.sum()  # a dark cell wide, and as long in meters
    assert blot == pytest.approx(both.broad.sharp / both.cells.sharp, rel=0.02)


def test_blots_are_as_wide_as_the_laser_is_noisy():
    room = ScanReader(CrsmParams())
    for noise, width in ((0.001, 1.0), (0.06, 3.0)):
        room.take(still(0), IDENTITY)
        room._noise.value = noise
        walls = WallGrid(CrsmParams(max_cells=1 << 20, sharp=5))
        walls.insert(room, IDENTITY)
        widths = walls.cells.blot[..., WIDTH]
        assert widths[widths > 0.0] == pytest.approx(width)


def test_beyond_the_map_it_is_not_dark():
    cells = grid()
    cells.dark[:] = 1.0
    assert darkness(cells, cells.corner[X], cells.corner[Y]) == 0.0
    assert darkness(cells, 1e3, 0.0) == 0.0
