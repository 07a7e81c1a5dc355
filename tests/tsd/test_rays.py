"""A ray that crosses two surfaces in one step shows the nearer one."""

import math

import numpy as np
import pytest

from tsd.map_kernels import LAYERS, SIDE, WALL, Field
from tsd.model_kernels import Fan, Model, cast_rays

CELL, TILES = 0.05, 8


def field_of(planes):
    """A field around (0, 0) with a linear distance in some layers: layer to f(x, y)."""
    n = TILES * SIDE
    centers = -0.5 * n * CELL + CELL * (np.arange(n) + 0.5)
    x, y = np.meshgrid(centers, centers)
    slots = np.zeros((TILES, TILES, LAYERS), np.int32)
    tiles = [np.full((SIDE, SIDE), np.nan)]
    for layer, plane in planes.items():
        values = plane(x, y)
        for ty in range(TILES):
            for tx in range(TILES):
                slots[ty, tx, layer] = len(tiles)
                part = values[ty * SIDE : (ty + 1) * SIDE, tx * SIDE : (tx + 1) * SIDE]
                tiles.append(part)
    tsd = np.array(tiles, np.float32)
    corner, seen = np.full(2, -0.5 * n * CELL), np.zeros((n, n), np.uint8)
    walls = np.zeros((n // WALL, n // WALL), np.float32)
    return Field(slots, tsd, np.ones_like(tsd), corner, CELL, np.array([len(tsd)]), seen, walls)


@pytest.mark.parametrize(("right", "top"), [(1.0, 1.002), (1.002, 1.0)])
def test_of_two_surfaces_in_one_step_the_nearer_one_is_seen(right, top):
    field = field_of({2: lambda x, y: right - x, 3: lambda x, y: top - y})
    model = Model(np.zeros((1, 5)), Fan(1, 0.25 * math.pi, 0.1, 5.0, 0), 0.0, 0.0, 0.0)
    assert cast_rays(field, model) == 1
    x, y, nx, ny, way = model.points[0]
    nearer = (-1.0, 0.0) if right < top else (0.0, -1.0)
    assert (nx, ny) == pytest.approx(nearer, abs=1e-4)
    assert way == pytest.approx(math.sqrt(2.0), abs=2e-3)
    assert (x, y) == pytest.approx((1.0, 1.0), abs=2e-3)
