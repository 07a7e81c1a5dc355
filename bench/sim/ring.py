"""A bare corridor once around a block: nothing but straight walls, the hardest case along them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bench.sim.canvas import Canvas
from bench.sim.world import World

if TYPE_CHECKING:
    from numpy.random import Generator

WALL = 0.2  # m
WIDTHS = (1.8, 2.2)  # m, of the corridor
LENGTHS = (24.0 / 26.0, 28.0 / 26.0)  # of the block, as a share of the size less two corridors
DEPTHS = (14.0 / 26.0, 18.0 / 26.0)


def ring(rng: Generator, resolution: float, size: float) -> World:
    """A ring corridor of about `size` x 2/3 `size` metres; same generator state, same ring."""
    width = float(rng.uniform(*WIDTHS))
    side = size - sum(WIDTHS)
    length, depth = side * float(rng.uniform(*LENGTHS)), side * float(rng.uniform(*DEPTHS))
    right, top = length + 2.0 * width, depth + 2.0 * width
    canvas = Canvas.solid(right + 2.0 * WALL, top + 2.0 * WALL, resolution)
    canvas.carve(WALL, WALL, WALL + right, WALL + top)
    block = (WALL + width, WALL + width, WALL + width + length, WALL + width + depth)
    canvas.occupied[canvas.area(*block)] = True
    canvas.hide(block[0] + WALL, block[1] + WALL, block[2] - WALL, block[3] - WALL)
    return canvas.world()
