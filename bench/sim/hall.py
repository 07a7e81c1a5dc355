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

HALL_WALL_THICKNESS = 0.3  # m
HALL_CLEARANCE = 0.5  # m on both sides of a path
AISLE_WIDTHS = (1.8, 2.6)  # m between two rows of racks
MAIN_AISLE_WIDTH = 2.4  # m, free along the walls and across the middle
RACK_DEPTH = 1.1  # m, of a single row
FULL_BAY_SHARES = (0.5, 0.85)  # of all bays of racks
PILLAR_SPACINGS = (5.0, 7.0)  # m
PILLAR_WIDTHS = (0.35, 0.6)  # m
AREA_PER_CLUTTER = 4.0  # m^2 for each attempt to place an object
CLUTTER_MAKERS = (furniture.pallets, furniture.crates, furniture.crates, furniture.machine)


@dataclass
class Hall:
    """The canvas, the inner size [m] of the hall and the y coordinate [m] of its main aisle."""

    canvas: Canvas
    width: float
    depth: float
    aisle: float

    @property
    def inner(self) -> tuple[float, float, float, float]:
        """Left, bottom, right and top wall [m]."""
        wall = HALL_WALL_THICKNESS
        return wall, wall, wall + self.width, wall + self.depth

    def stand(self, piece: Piece, left: float, bottom: float, quarters: int, gap: float) -> bool:
        """Place a piece with a free `gap` [m] to all but the walls; whether it was possible."""
        dx, dy = piece.sides(quarters)
        right, top = left + dx, bottom + dy
        wall = self.inner
        around = (
            max(left - gap, wall[0]),
            max(bottom - gap, wall[1]),
            min(right + gap, wall[2]),
            min(top + gap, wall[3]),
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
    wall = HALL_WALL_THICKNESS
    canvas = Canvas.solid(width + 2.0 * wall, depth + 2.0 * wall, resolution)
    canvas.carve(wall, wall, wall + width, wall + depth)
    place = Hall(canvas, width, depth, wall + depth * float(rng.uniform(0.4, 0.6)))
    share = float(rng.uniform(0.35, 0.55))
    start = 0.0 if rng.random() < 0.5 else 1.0 - share
    _racks(place, wall + start * width, wall + (start + share) * width, rng)
    _pillars(place, rng)
    _clutter(place, rng)
    return canvas.world()


def _racks(hall: Hall, left: float, right: float, rng: Generator) -> None:
    """Rows across the hall, single or back to back, separated by the main aisle."""
    wall, main, half = hall.inner, MAIN_AISLE_WIDTH, 0.5 * MAIN_AISLE_WIDTH
    spans = ((wall[1] + main, hall.aisle - half), (hall.aisle + half, wall[3] - main))
    x, end = max(left, wall[0] + main), min(right, wall[2] - main)
    full = float(rng.uniform(*FULL_BAY_SHARES))
    while x + RACK_DEPTH < end:
        for _ in range(int(rng.integers(1, 3))):
            for bottom, top in spans:
                hall.stand(furniture.rack(top - bottom, RACK_DEPTH, full, rng), x, bottom, 1, 0.0)
            x += RACK_DEPTH
        x += float(rng.uniform(*AISLE_WIDTHS))


def _pillars(hall: Hall, rng: Generator) -> None:
    """Evenly spaced pillars where no rack stands."""
    edge = float(rng.uniform(*PILLAR_WIDTHS))
    sides = hall.width, hall.depth
    nx, ny = (max(2, round(side / float(rng.uniform(*PILLAR_SPACINGS)))) for side in sides)
    pillar = furniture.Piece(edge, edge, [furniture.box(0.0, 0.0, edge, edge)])
    for iy in range(1, ny):
        for ix in range(1, nx):
            x = HALL_WALL_THICKNESS + hall.width * ix / nx
            y = HALL_WALL_THICKNESS + hall.depth * iy / ny
            hall.stand(pillar, x - 0.5 * edge, y - 0.5 * edge, 0, 2.0 * HALL_CLEARANCE)


def _clutter(hall: Hall, rng: Generator) -> None:
    """Pallets, boxes and machines on the open floor, moved to a wall that is near."""
    wall, half = HALL_WALL_THICKNESS, 0.5 * MAIN_AISLE_WIDTH
    for _ in range(int(hall.width * hall.depth / AREA_PER_CLUTTER)):
        piece = CLUTTER_MAKERS[int(rng.integers(len(CLUTTER_MAKERS)))](rng)
        quarters = int(rng.integers(2))
        dx, dy = piece.sides(quarters)
        left = _to_wall(float(rng.uniform(0.0, hall.width - dx)), hall.width - dx)
        bottom = _to_wall(float(rng.uniform(0.0, hall.depth - dy)), hall.depth - dy)
        if bottom + dy + wall < hall.aisle - half or bottom + wall > hall.aisle + half:
            hall.stand(piece, wall + left, wall + bottom, quarters, 2.0 * HALL_CLEARANCE)


def _to_wall(place: float, last: float) -> float:
    """`place` in 0 to `last`, moved to an end that is too near to pass."""
    if place < 2.0 * HALL_CLEARANCE:
        return 0.0
    return last if last - place < 2.0 * HALL_CLEARANCE else place
