"""A bare ring corridor around a block: its straight walls leave one direction degenerate."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bench.sim.canvas import Canvas
from bench.sim.world import World

if TYPE_CHECKING:
    from numpy.random import Generator

RING_WALL_THICKNESS = 0.2  # m
RING_CORRIDOR_WIDTHS = (1.8, 2.2)  # m
BLOCK_LENGTH_SHARES = (24.0 / 26.0, 28.0 / 26.0)  # of the size without two corridors
BLOCK_DEPTH_SHARES = (14.0 / 26.0, 18.0 / 26.0)


def ring(rng: Generator, resolution: float, size: float) -> World:
    """A ring corridor of about `size` x 2/3 `size` metres; same generator state, same ring."""
    width = float(rng.uniform(*RING_CORRIDOR_WIDTHS))
    side = size - sum(RING_CORRIDOR_WIDTHS)
    length = side * float(rng.uniform(*BLOCK_LENGTH_SHARES))
    depth = side * float(rng.uniform(*BLOCK_DEPTH_SHARES))
    right, top, wall = length + 2.0 * width, depth + 2.0 * width, RING_WALL_THICKNESS
    canvas = Canvas.solid(right + 2.0 * wall, top + 2.0 * wall, resolution)
    canvas.carve(wall, wall, wall + right, wall + top)
    block = (wall + width, wall + width, wall + width + length, wall + width + depth)
    canvas.occupied[canvas.area(*block)] = True
    canvas.hide(block[0] + wall, block[1] + wall, block[2] - wall, block[3] - wall)
    return canvas.world()
