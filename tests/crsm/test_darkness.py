"""The dark field between its cells: quadratic splines, and blots that count less together."""

import math

import numpy as np
import pytest

from crsm.map import WallGrid
from crsm.map_kernels import BLUR, FULL, HALF, HALO, X, Y, add_blot, darkness
from crsm.params import CrsmParams


def grid():
    return WallGrid(CrsmParams(max_cells=1 << 16)).cells


def spline(d):
    """The quadratic B-spline at a distance [cell]."""
    d = abs(d)
    return 0.75 - d * d if d < 0.5 else 0.5 * max(1.5 - d, 0.0) ** 2


def test_darkness_is_the_spline_of_the_cells_around():
    cells, rng = grid(), np.random.default_rng(0)
    cells.dark[:] = rng.random(cells.dark.shape)
    step, (x0, y0) = cells.cell / cells.fine, cells.corner
    for u, v in rng.uniform(20.0, 40.0, (20, 2)):
        ix, iy = math.floor(u), math.floor(v)
        total = sum(
            spline(u - i - 0.5) * spline(v - j - 0.5) * cells.dark[j, i]
            for i in range(ix - 2, ix + 3)
            for j in range(iy - 2, iy + 3)
        )
        expected = (1.0 + HALF) * total / (HALF * FULL + total)
        assert darkness(cells, x0 + u * step, y0 + v * step) == pytest.approx(expected, rel=1e-6)


def test_a_blot_is_a_gaussian_around_its_point_and_taken_away_leaves_nothing():
    cells = grid()
    step, (x0, y0) = cells.cell / cells.fine, cells.corner
    u, v = 30.3, 25.8
    add_blot(cells, x0 + u * step, y0 + v * step, 1.0)
    for j, i in ((25, 30), (24, 31), (26, 28), (25 + HALO, 30 - HALO)):
        d2 = (i + 0.5 - u) ** 2 + (j + 0.5 - v) ** 2
        assert cells.dark[j, i] == pytest.approx(math.exp(-d2 / (2.0 * BLUR * BLUR)), rel=1e-5)
    add_blot(cells, x0 + u * step, y0 + v * step, -1.0)
    assert np.abs(cells.dark).max() < 1e-6


def test_beyond_the_map_it_is_not_dark():
    cells = grid()
    cells.dark[:] = 1.0
    assert darkness(cells, cells.corner[X], cells.corner[Y]) == 0.0
    assert darkness(cells, 1e3, 0.0) == 0.0
