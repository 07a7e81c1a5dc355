"""A seeded hall with clutter: pillars, racks in rows, pallets, machines, boxes at all angles.

Racks stand in one part, the rest is open floor. Between any two things that don't touch there is
room for a robot, and the aisle across the middle is free from end to end.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bench.sim import furniture
from bench.sim.canvas import Canvas
from bench.sim.world import World

if TYPE_CHECKING:
    from numpy.random import Generator

    from bench.sim.furniture import Piece

WALL = 0.3  # m
WAY = 0.5  # m, kept free on both sides of a way
AISLES = (1.8, 2.6)  # m, between two rows of racks
MAIN = 2.4  # m, free along the walls and across the middle
RACK = 1.1  # m, depth of a single row of racks
FULL = (0.5, 0.85)  # share of the bays with something in them
BAYS = (5.0, 7.0)  # m, from pillar to pillar
PILLARS = (0.35, 0.6)  # m, edge of a pillar
CLUTTER = 4.0  # m^2 for each thing that is tried to be put somewhere
CLUTTERING = (furniture.pallets, furniture.crates, furniture.crates, furniture.machine)


@dataclass
class Hall:
    """The canvas, the clear inner size [m] of the hall and where its main aisle runs (y) [m]."""

    canvas: Canvas
    width: float
    depth: float
    aisle: float

    @property
    def inner(self) -> tuple[float, float, float, float]:
        """Left, bottom, right and top wall [m]."""
        return WALL, WALL, WALL + self.width, WALL + self.depth

    def stand(self, piece: Piece, left: float, bottom: float, quarters: int, room: float) -> bool:
        """Put a piece down with `room` [m] to all but the walls; was there room?"""
        dx, dy = piece.sides(quarters)
        right, top = left + dx, bottom + dy
        wall = self.inner
        around = (
            max(left - room, wall[0]),
            max(bottom - room, wall[1]),
            min(right + room, wall[2]),
            min(top + room, wall[3]),
        )
        if right > wall[2] or top > wall[3] or not self.canvas.is_free(*around):
            return False
        for outline in piece.at(left, bottom, quarters):
            self.canvas.fill(outline)
        return True


def hall(rng: Generator, resolution: float, size: float) -> World:
    """A hall of about `size` x 2/3 `size` metres; same generator state, same hall."""
    width = size * float(rng.uniform(0.95, 1.05))
    depth = size * float(rng.uniform(0.62, 0.71))
    canvas = Canvas.solid(width + 2.0 * WALL, depth + 2.0 * WALL, resolution)
    canvas.carve(WALL, WALL, WALL + width, WALL + depth)
    place = Hall(canvas, width, depth, WALL + depth * float(rng.uniform(0.4, 0.6)))
    share = float(rng.uniform(0.35, 0.55))
    start = 0.0 if rng.random() < 0.5 else 1.0 - share
    _racks(place, WALL + start * width, WALL + (start + share) * width, rng)
    _pillars(place, rng)
    _clutter(place, rng)
    return canvas.world()


def _racks(hall: Hall, left: float, right: float, rng: Generator) -> None:
    """Rows across the hall, single or back to back, parted by the main aisle."""
    wall, half = hall.inner, 0.5 * MAIN
    spans = ((wall[1] + MAIN, hall.aisle - half), (hall.aisle + half, wall[3] - MAIN))
    x, end = max(left, wall[0] + MAIN), min(right, wall[2] - MAIN)
    full = float(rng.uniform(*FULL))
    while x + RACK < end:
        for _ in range(int(rng.integers(1, 3))):
            for bottom, top in spans:
                hall.stand(furniture.rack(top - bottom, RACK, full, rng), x, bottom, 1, 0.0)
            x += RACK
        x += float(rng.uniform(*AISLES))


def _pillars(hall: Hall, rng: Generator) -> None:
    """Pillars at even distances, where no rack stands."""
    edge = float(rng.uniform(*PILLARS))
    nx, ny = (max(2, round(side / float(rng.uniform(*BAYS)))) for side in (hall.width, hall.depth))
    pillar = furniture.Piece(edge, edge, [furniture.box(0.0, 0.0, edge, edge)])
    for iy in range(1, ny):
        for ix in range(1, nx):
            x, y = WALL + hall.width * ix / nx, WALL + hall.depth * iy / ny
            hall.stand(pillar, x - 0.5 * edge, y - 0.5 * edge, 0, 2.0 * WAY)


def _clutter(hall: Hall, rng: Generator) -> None:
    """Pallets, boxes and machines on the open floor, what comes near a wall close to it."""
    for _ in range(int(hall.width * hall.depth / CLUTTER)):
        piece = CLUTTERING[int(rng.integers(len(CLUTTERING)))](rng)
        quarters = int(rng.integers(2))
        dx, dy = piece.sides(quarters)
        left = _to_wall(float(rng.uniform(0.0, hall.width - dx)), hall.width - dx)
        bottom = _to_wall(float(rng.uniform(0.0, hall.depth - dy)), hall.depth - dy)
        if bottom + dy + WALL < hall.aisle - 0.5 * MAIN or bottom + WALL > hall.aisle + 0.5 * MAIN:
            hall.stand(piece, WALL + left, WALL + bottom, quarters, 2.0 * WAY)


def _to_wall(place: float, last: float) -> float:
    """`place` from 0 to `last`, at an end where it would leave no way beside it."""
    if place < 2.0 * WAY:
        return 0.0
    return last if last - place < 2.0 * WAY else place
