"""A seeded office floor: corridors, rooms with open doors on both sides, furniture.

Corridors run the length of the floor one above the other, with rows of rooms below and above each,
and are joined by others across, so that there are loops; here and there two rows make room for one
of open plan. A drive that keeps 0.3 m off everything comes into every room.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

from bench.sim import furniture
from bench.sim.canvas import Canvas
from bench.sim.world import World

if TYPE_CHECKING:
    from numpy.random import Generator

    from bench.sim.furniture import Piece, PieceMaker

OUTER = 0.3  # m, thickness of the outer walls
WALL = 0.1  # m, of all others
DOORS = (0.9, 1.0)  # m, opening of a door
CORRIDORS = (1.8, 2.2)  # m, width
ROOMS = (3.0, 6.0)  # m, width
HALVES = (0.46, 0.54)  # share of the depth beside a corridor that the rooms below it have
MODULE = 12.5  # m, depth of a corridor with its rooms
CROSSING = 20.0  # m, about, from one corridor across to the next
OPEN_PLAN = (7.0, 10.0)  # m, width of a room of open plan
WAY = 0.43  # m, kept free on both sides of a way
STEP = 1.2  # m, of the corridor before a door that its room's furniture is checked with
PIECES: tuple[PieceMaker, ...] = (
    furniture.desk,
    furniture.desk,
    furniture.desk,
    furniture.cupboard,
    furniture.cupboard,
    furniture.table,
    furniture.bin_or_plant,
    furniture.copier,
)


@dataclass(frozen=True)
class Room:
    """A rectangle [m] between walls, with the corridor `below` or `above` or both."""

    left: float
    bottom: float
    right: float
    top: float
    below: bool
    above: bool

    @property
    def width(self) -> float:
        """From the left wall to the right."""
        return self.right - self.left

    @property
    def depth(self) -> float:
        """From the lower wall to the upper."""
        return self.top - self.bottom


@dataclass
class Floor:
    """Rooms, corridors as rectangles (left, bottom, right, top) [m], and places of doors."""

    width: float
    depth: float
    corridors: list[tuple[float, float, float, float]] = field(default_factory=list)
    rooms: list[Room] = field(default_factory=list)


def office(rng: Generator, resolution: float, size: float) -> World:
    """An office floor of about `size` x 5/8 `size` metres; same generator state, same floor."""
    floor = _floor(size, 0.625 * size, rng)
    canvas = Canvas.solid(floor.width + 2.0 * OUTER, floor.depth + 2.0 * OUTER, resolution)
    for corridor in floor.corridors:
        canvas.carve(*corridor)
    for room in floor.rooms:
        canvas.carve(room.left, room.bottom, room.right, room.top)
    for room in floor.rooms:
        _doors(canvas, room, rng)
    for room in floor.rooms:
        _furnish(canvas, room, rng)
    return canvas.world()


def _floor(width: float, depth: float, rng: Generator) -> Floor:
    """Corridors and rooms, bottom up."""
    floor = Floor(width, depth)
    n = max(1, round(depth / MODULE))
    bands = [_band(OUTER + k * depth / n, depth / n, rng) for k in range(n)]
    right = OUTER + width
    floor.corridors = [(OUTER, low, right, high) for low, high in bands]
    _row(floor, (OUTER, right), (OUTER, bands[0][0] - WALL), False, True, rng)
    for (_, low), (high, _) in pairwise(bands):
        _between(floor, low, high, rng)
    _row(floor, (OUTER, right), (bands[-1][1] + WALL, OUTER + depth), True, False, rng)
    return floor


def _band(bottom: float, depth: float, rng: Generator) -> tuple[float, float]:
    """Lower and upper wall of the corridor of a module."""
    width = float(rng.uniform(*CORRIDORS))
    low = bottom + (depth - width) * float(rng.uniform(*HALVES))
    return low, low + width


def _between(floor: Floor, low: float, high: float, rng: Generator) -> None:
    """Corridors across from `low` to `high`, and between them rooms back to back."""
    n = max(1, round(floor.width / CROSSING))
    left = OUTER
    for k in range(n):
        middle = OUTER + floor.width * (k + 0.5 + float(rng.uniform(-0.15, 0.15))) / n
        half = 0.5 * float(rng.uniform(*CORRIDORS))
        floor.corridors.append((middle - half, low, middle + half, high))
        _rows(floor, (left, middle - half - WALL), (low + WALL, high - WALL), rng)
        left = middle + half + WALL
    _rows(floor, (left, OUTER + floor.width), (low + WALL, high - WALL), rng)


def _rows(
    floor: Floor, along: tuple[float, float], across: tuple[float, float], rng: Generator
) -> None:
    """Two rows of rooms, or at the left end or all of it one room of open plan."""
    (left, right), (bottom, top) = along, across
    plan = float(rng.uniform(*OPEN_PLAN))
    if right - left > OPEN_PLAN[0] and rng.random() < 0.5:
        end = left + plan if right - left - plan > ROOMS[0] else right
        floor.rooms.append(Room(left, bottom, end, top, True, True))
        left = end + WALL
    if right - left < 1.5:
        return
    middle = bottom + (top - bottom) * float(rng.uniform(*HALVES))
    _row(floor, (left, right), (bottom, middle - 0.5 * WALL), True, False, rng)
    _row(floor, (left, right), (middle + 0.5 * WALL, top), False, True, rng)


def _row(
    floor: Floor,
    along: tuple[float, float],
    across: tuple[float, float],
    below: bool,
    above: bool,
    rng: Generator,
) -> None:
    """Rooms side by side that fill a rectangle; now and then a wide one."""
    left, right = along
    n = max(1, round((right - left) / 4.4))
    shares = rng.uniform(*ROOMS, n)
    if n > 3 and rng.random() < 0.4:
        shares[int(rng.integers(n))] *= 2.0
    for width in ((right - left + WALL) * shares / shares.sum()).tolist():
        floor.rooms.append(Room(left, across[0], left + width - WALL, across[1], below, above))
        left += width


def _doors(canvas: Canvas, room: Room, rng: Generator) -> None:
    """A door to each corridor beside a room, two in a wide room."""
    for there, wall in ((room.below, room.bottom - WALL), (room.above, room.top)):
        if not there:
            continue
        for k in range(n := 1 if room.width < OPEN_PLAN[0] else 2):
            share = room.width / n
            wanted = float(rng.uniform(*DOORS))
            slack = share - wanted - 0.3
            left = room.left + k * share + 0.15 + float(rng.uniform(0.0, slack))
            _opening(canvas, left, wall, wanted)


def _opening(canvas: Canvas, left: float, bottom: float, width: float) -> None:
    """Carve a door into a horizontal wall, never narrower than `width`."""
    cell = canvas.resolution
    left = round(left / cell) * cell
    right = left + math.ceil(width / cell - 1e-6) * cell
    canvas.carve(left, bottom - 0.5 * WALL, right, bottom + 1.5 * WALL)


def _furnish(canvas: Canvas, room: Room, rng: Generator) -> None:
    """Desks and cupboards along the walls, tables in the middle, about one piece to 4 m^2."""
    area = canvas.area(
        room.left - WALL,
        room.bottom - (WALL + STEP if room.below else WALL),
        room.right + WALL,
        room.top + (WALL + STEP if room.above else WALL),
    )
    for _ in range(int(room.width * room.depth / 4.0)):
        piece = PIECES[int(rng.integers(len(PIECES)))](rng)
        for _ in range(3):
            placed = _place(room, piece, rng)
            if placed is None:
                continue
            left, bottom, quarters = placed
            dx, dy = piece.sides(quarters)
            free = canvas.is_free(left, bottom, left + dx, bottom + dy)
            if free and canvas.put(piece.at(left, bottom, quarters), WAY, area):
                break


def _place(room: Room, piece: Piece, rng: Generator) -> tuple[float, float, int] | None:
    """Lower left corner and quarter turns of a piece with its back to a wall, a table anywhere."""
    quarters = int(rng.integers(4))
    dx, dy = piece.sides(quarters)
    free_x, free_y = room.width - dx - 0.04, room.depth - dy - 0.04
    if min(free_x, free_y) < 0.0:
        return None
    x, y = float(rng.uniform(0.0, free_x)), float(rng.uniform(0.0, free_y))
    if not piece.free:  # back to the wall
        x = (x, free_x, x, 0.0)[quarters]
        y = (0.0, y, free_y, y)[quarters]
    return room.left + 0.02 + x, room.bottom + 0.02 + y, quarters
